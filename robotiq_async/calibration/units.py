"""Units: converts between mm, mm/s, seconds or newtons and the gripper's values 0..255."""

from __future__ import annotations

from dataclasses import dataclass, field
from functools import lru_cache
from typing import overload

from ..values.checks import check_number
from ..values.model import THREE_FINGER
from ..values.stroke import Stroke
from .scales import Figures, ForceCalibration, SpeedCalibration, covered, outwards


@dataclass(frozen=True, slots=True, repr=False)
class Units:
    """Converts both ways: ``hand.units.position(mm=80)``, ``hand.units.mm(120)``.

    **Openings are nominal**, unless the hand was made with measured points: the manual's stroke, on the arc
    of its linkage for a 2F, and linear in counts for a Hand-E and for a finger of a 3-Finger, although that
    rotates. They apply to the fingers, not to the scissor. Where the fingertips of a 3-Finger meet early, as
    at about 113 counts in pinch mode, the real opening is 0 while these conversions give 84 mm.

    **Fractions** are the share of the travel that is open, 1 (open) .. 0 (closed), linear in counts.

    **Forces are labels**: a straight line between the manual's two figures, which the manual calls not
    linear, or the readings of one scale. They order the force values; they are not the force on a part.

    Attributes:
        speeds: closing times by speed value; by default the thesis's.
        forces: labels of the force values; by default the manual's figures.
        stroke: openings by position; by default a 3-Finger's.
    """

    speeds: SpeedCalibration = field(default_factory=SpeedCalibration.thesis)
    forces: ForceCalibration = field(default_factory=ForceCalibration.nominal)
    stroke: Stroke = THREE_FINGER.stroke
    _mm_per_s: Figures = field(init=False, repr=False, compare=False)
    _closing_s: Figures = field(init=False, repr=False, compare=False)
    _label_n: Figures = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        """Check the tables.

        Raises:
            TypeError: a table has the wrong type.
        """
        for name, kind in (
            ("speeds", SpeedCalibration),
            ("forces", ForceCalibration),
            ("stroke", Stroke),
        ):
            if not isinstance(getattr(self, name), kind):
                raise TypeError(f"{name} must be a {kind.__name__}, got {getattr(self, name)!r}")
        keep = object.__setattr__
        keep(self, "_mm_per_s", _mm_per_s(self.speeds))
        keep(self, "_closing_s", _closing_s(self.speeds))
        keep(self, "_label_n", _label_n(self.forces))

    def __reduce__(self) -> tuple[object, ...]:
        return Units, (self.speeds, self.forces, self.stroke)

    # -- to counts -------------------------------------------------------------------------------------

    @overload
    def position(self, *, mm: float) -> int: ...

    @overload
    def position(self, *, open_fraction: float) -> int: ...

    def position(self, *, mm: float | None = None, open_fraction: float | None = None) -> int:
        """The position, in counts, that comes closest to an opening.

        A count is about 0.4 mm on a 2F-85, 0.6 mm on a 2F-140 and 0.2 mm on a Hand-E.

        Args:
            mm: millimetres between the fingertips, 0 (closed) .. the stroke (open); of a gripper with
                measured points from their least to their most.
            open_fraction: instead of it, the share of the travel that is open: 1 (open) .. 0 (closed). The
                ends are 0 and 255 counts, as of ``open()`` and ``close()``.

        Raises:
            TypeError: not a number, or not exactly one of the two arguments.
            ValueError: outside the range, which the message gives in the same unit.
        """
        if (mm is None) == (open_fraction is None):
            raise TypeError("position() takes one of mm and open_fraction")
        if mm is None:
            return self.stroke.position_at(open_fraction)  # type: ignore[arg-type]  # one of the two is given
        return self.stroke.position_of(mm)

    @overload
    def speed(self, *, mm_per_s: float) -> int: ...

    @overload
    def speed(self, *, closing_s: float) -> int: ...

    def speed(self, *, mm_per_s: float | None = None, closing_s: float | None = None) -> int:
        """The speed value, 0..255, closest to a speed or to the time of a full closing.

        Args:
            mm_per_s: millimetres of opening a second. Of a 2F or a Hand-E its manual's range is accepted:
                where the gripper does not reach it, the closest value is taken. The only recorded 2F-85
                moved with 20.6 to 138 mm/s, where the manual says 20 to 150.
            closing_s: seconds from open to closed, instead of a speed.

        Raises:
            TypeError: not a number, or not exactly one of the two arguments.
            ValueError: slower or faster than any value; the message uses the same unit.
        """
        if (mm_per_s is None) == (closing_s is None):
            raise TypeError("speed() takes one of mm_per_s and closing_s")
        if closing_s is not None:
            return _closest("closing_s", closing_s, self._closing_s, "seconds")
        return _closest("mm_per_s", mm_per_s, self._mm_per_s, "millimetres a second")

    def force(self, *, label_n: float) -> int:
        """The force value, 0..255, with the closest label; the lowest of several.

        Args:
            label_n: newtons of the label, not a measured force; see the class.

        Raises:
            TypeError: not a number.
            ValueError: outside the labels; the message uses newtons.
        """
        return _closest("label_n", label_n, self._label_n, "newton of a label (no measured force)")

    # -- from counts -----------------------------------------------------------------------------------

    def mm(self, position: int) -> float:
        """The opening at a position, in millimetres; of a 3-Finger 155 at 6 and below, 0 from 241 on.

        Args:
            position: counts, 0..255.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255.
        """
        return self.stroke.opening_mm(position)

    def open_fraction(self, position: int) -> float:
        """The share of the travel that is open at a position: 1 (open) .. 0 (closed), linear in counts.

        Args:
            position: counts, 0..255.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255.
        """
        return self.stroke.open_fraction(position)

    def mm_per_s(self, speed: int) -> float:
        """Millimetres of opening a second, at a speed value.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside the measured range.
        """
        return self.speeds.mm_per_s(speed)

    def closing_s(self, speed: int) -> float:
        """Seconds of a full closing, at a speed value.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside the measured range.
        """
        return self.speeds.closing_time(speed)

    def label_n(self, force: int) -> float:
        """The label of a force value, in newtons: not a measured force; see the class.

        Raises:
            TypeError: not an int.
            ValueError: outside 0..255, or outside the measured range.
        """
        return self.forces.newton(force)

    def __repr__(self) -> str:
        return (
            f"<Units {self.stroke.closed_mm:g}..{self.stroke.mm:g} mm ({self.stroke.source}), "
            f"{_words(self._mm_per_s)} mm/s ({self.speeds.source}), "
            f"labels {_words(self._label_n)} N ({self.forces.source})>"
        )


# Cached: making one takes a millisecond, and most hands have the same.


@lru_cache(maxsize=8)
def _closing_s(speeds: SpeedCalibration) -> Figures:
    return Figures({value: speeds.closing_time(value) for value in covered(speeds.points)})


@lru_cache(maxsize=8)
def _mm_per_s(speeds: SpeedCalibration) -> Figures:
    return speeds.rates()


@lru_cache(maxsize=8)
def _label_n(forces: ForceCalibration) -> Figures:
    return Figures({value: forces.newton(value) for value in covered(forces.points)})


def _closest(name: str, wanted: object, figures: Figures, unit: str) -> int:
    return figures.nearest(check_number(name, wanted, *figures.limits, unit))


def _words(figures: Figures) -> str:
    low, high = outwards(figures.low, figures.high)
    return f"{low:g}..{high:g}"
