"""Units: converts between mm, mm/s, seconds or newtons and the gripper's values 0..255."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import ceil, floor
from typing import overload

from ..checks import check_number
from .scales import ForceCalibration, SpeedCalibration, covered, nearest


@dataclass(frozen=True, slots=True, repr=False)
class Units:
    """Converts both ways: ``await hand.move(hand.units.position(mm=80))``.

    **Openings are nominal**: the manual's stroke, treated as linear in counts although a real finger rotates.
    They apply to the fingers, not to the scissor. Where the fingertips meet early, as at about 113 counts in
    pinch mode, the real opening is 0 while these conversions give 84 mm.

    **Forces are labels**: a straight line between the manual's two figures, which the manual calls not
    linear, or the readings of one scale. They order the force values; they do not tell the force on a part.

    Attributes:
        speeds: what speed values mean; by default the thesis's closing times.
        forces: labels of the force values; by default the manual's figures.
    """

    speeds: SpeedCalibration = field(default_factory=SpeedCalibration.thesis)
    forces: ForceCalibration = field(default_factory=ForceCalibration.nominal)

    def __post_init__(self) -> None:
        """Check the tables.

        Raises:
            TypeError: a table has the wrong type.
        """
        for name, kind in (("speeds", SpeedCalibration), ("forces", ForceCalibration)):
            if not isinstance(getattr(self, name), kind):
                raise TypeError(f"{name} must be a {kind.__name__}, got {getattr(self, name)!r}")

    # -- to counts -------------------------------------------------------------------------------------

    def position(self, *, mm: float) -> int:
        """The position, in counts, that comes closest to an opening.

        Args:
            mm: nominal millimetres between the fingertips, 0 (closed) .. 155 (open).

        Raises:
            TypeError: not a number.
            ValueError: outside 0..155 mm.
        """
        stroke = self.speeds.stroke
        return stroke.position_of(check_number("mm", mm, 0.0, stroke.mm, "millimetres"))

    @overload
    def speed(self, *, mm_per_s: float) -> int: ...

    @overload
    def speed(self, *, closing_s: float) -> int: ...

    def speed(self, *, mm_per_s: float | None = None, closing_s: float | None = None) -> int:
        """The speed value, 0..255, closest to a speed or to the time of a full closing.

        Args:
            mm_per_s: millimetres of opening a second.
            closing_s: seconds from open to closed, instead of a speed.

        Raises:
            TypeError: not a number, or not exactly one of the two arguments.
            ValueError: slower or faster than any value; the message uses the same unit.
        """
        if (mm_per_s is None) == (closing_s is None):
            raise TypeError("speed() takes one of mm_per_s and closing_s")
        if closing_s is not None:
            return _closest("closing_s", closing_s, _closing_times(self.speeds), "seconds")
        return _closest("mm_per_s", mm_per_s, _mm_per_s(self.speeds), "millimetres a second")

    def force(self, *, label_n: float) -> int:
        """The force value, 0..255, with the closest label; the lowest of several.

        Args:
            label_n: newtons of the label, not a measured force; see the class.

        Raises:
            TypeError: not a number.
            ValueError: outside the labels; the message uses newtons.
        """
        return _closest("label_n", label_n, _labels(self.forces), "newton of a label (no measured force)")

    # -- from counts -----------------------------------------------------------------------------------

    def mm(self, position: int) -> float:
        """The nominal opening at a position, in millimetres: 155 at 6 and below, 0 from 241 on.

        Args:
            position: counts, 0..255.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255.
        """
        return self.speeds.stroke.opening_mm(position)

    def mm_per_s(self, speed: int) -> float:
        """Millimetres of opening a second, at a speed value.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside what was measured.
        """
        return self.speeds.mm_per_s(speed)

    def closing_s(self, speed: int) -> float:
        """Seconds of a full closing, at a speed value.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside what was measured.
        """
        return self.speeds.closing_time(speed)

    def label_n(self, force: int) -> float:
        """The label of a force value, in newtons: not a measured force; see the class.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside what was measured.
        """
        return self.forces.newton(force)

    def __repr__(self) -> str:
        return (
            f"<Units 0..{self.speeds.stroke.mm:g} mm (nominal), "
            f"{_words(_mm_per_s(self.speeds))} mm/s ({self.speeds.source}), "
            f"labels {_words(_labels(self.forces))} N ({self.forces.source})>"
        )


# Cached: control loops ask in every cycle, and building a table takes a millisecond.


@lru_cache(maxsize=8)
def _closing_times(speeds: SpeedCalibration) -> Mapping[int, float]:
    return {value: speeds.closing_time(value) for value in covered(speeds.points)}


@lru_cache(maxsize=8)
def _mm_per_s(speeds: SpeedCalibration) -> Mapping[int, float]:
    return {value: speeds.mm_per_s(value) for value in covered(speeds.points)}


@lru_cache(maxsize=8)
def _labels(forces: ForceCalibration) -> Mapping[int, float]:
    return {value: forces.newton(value) for value in covered(forces.points)}


def _closest(name: str, wanted: object, figures: Mapping[int, float], unit: str) -> int:
    return nearest(check_number(name, wanted, *_limits(figures), unit), figures)


def _limits(figures: Mapping[int, float]) -> tuple[float, float]:
    """Rounded outwards to two digits, so that a limit copied from a message is accepted."""
    return floor(min(figures.values()) * 100) / 100, ceil(max(figures.values()) * 100) / 100


def _words(figures: Mapping[int, float]) -> str:
    low, high = _limits(figures)
    return f"{low:g}..{high:g}"
