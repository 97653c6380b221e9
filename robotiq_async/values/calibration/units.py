"""Units: between what people say (mm, mm/s, seconds, newton) and what the gripper takes (0..255)."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import lru_cache
from math import ceil, floor
from typing import overload

from ..checks import check_number
from .scales import (
    STROKE_MM,
    ForceCalibration,
    SpeedCalibration,
    covered,
    nearest,
    opening_mm,
    position_of_opening,
)


@dataclass(frozen=True, slots=True, repr=False)
class Units:
    """Converts both ways: ``await hand.move(hand.units.position(mm=80))``.

    **Openings are nominal**: the manual's stroke, taken for linear in the counts. A real finger turns. They
    are those of the fingers; the scissor has none. Where fingertips meet early, as in the pinch mode at about
    113 counts, the opening is 0 there, and not the 84 mm that this says.

    **Forces are labels**, whatever the table: the manual's two figures on a straight line that it says is
    none, or what a scale showed once. They order the force values; what a part feels is another matter.

    Attributes:
        speeds: what speed values mean; the thesis's closing times unless it is told otherwise.
        forces: what force values are labelled with; the manual's figures unless it is told otherwise.
    """

    speeds: SpeedCalibration = field(default_factory=SpeedCalibration.thesis)
    forces: ForceCalibration = field(default_factory=ForceCalibration.nominal)

    def __post_init__(self) -> None:
        """Check the tables.

        Raises:
            TypeError: one of them is none.
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
        return position_of_opening(check_number("mm", mm, 0.0, STROKE_MM, "millimetres"))

    @overload
    def speed(self, *, mm_per_s: float) -> int: ...

    @overload
    def speed(self, *, closing_s: float) -> int: ...

    def speed(self, *, mm_per_s: float | None = None, closing_s: float | None = None) -> int:
        """The speed value, 0..255, that comes closest to a speed, or to the time of a full closing.

        Args:
            mm_per_s: millimetres of opening a second.
            closing_s: seconds from open to closed, in place of a speed.

        Raises:
            TypeError: not a number, or not exactly one of the two.
            ValueError: slower or faster than any value; told in the unit.
        """
        if (mm_per_s is None) == (closing_s is None):
            raise TypeError("speed() takes one of mm_per_s and closing_s")
        if closing_s is not None:
            return _closest("closing_s", closing_s, _closing_times(self.speeds), "seconds")
        return _closest("mm_per_s", mm_per_s, _mm_per_s(self.speeds), "millimetres a second")

    def force(self, *, label_n: float) -> int:
        """The force value, 0..255, whose label comes closest; the lowest of several.

        Args:
            label_n: newton by the label, and not of a measurement; see the class.

        Raises:
            TypeError: not a number.
            ValueError: no value has such a label; told in newton.
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
        return opening_mm(position)

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
        """The label of a force value, in newton: no measured force; see the class.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside what was measured.
        """
        return self.forces.newton(force)

    def __repr__(self) -> str:
        """Ranges and sources."""
        return (
            f"<Units 0..{STROKE_MM:g} mm (nominal), "
            f"{_words(_mm_per_s(self.speeds))} mm/s ({self.speeds.source}), "
            f"labels {_words(_labels(self.forces))} N ({self.forces.source})>"
        )


# Kept, for control loops ask at every turn, and a table takes a millisecond.


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
    """To two digits, outwards: whoever asks for a limit as it was told gets it."""
    return floor(min(figures.values()) * 100) / 100, ceil(max(figures.values()) * 100) / 100


def _words(figures: Mapping[int, float]) -> str:
    low, high = _limits(figures)
    return f"{low:g}..{high:g}"
