"""Scales of the values 0..255: millimetres, millimetres a second, seconds, newtons.

Sources, named by :attr:`SpeedCalibration.source`: the thesis's measurements of a 3-Finger, recordings of a
2F-85, an estimate for the other siblings, the manual's nominal figures, and your own tables from
``robotiq-async measure``. Moves and statuses use counts; these helpers convert.

A force value is a label, not a measured force: the manual gives 15 N at 0 and 60 N at 255 (2014, p. 47) and
calls the curve between them not linear. Scale readings (thesis, chapter 6) depend more on the object than on
the value.
"""

from __future__ import annotations

from bisect import bisect_left, bisect_right
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import cache
from math import ceil, floor
from pathlib import Path
from typing import Final

from ..values.checks import check_byte, check_number
from ..values.model import THREE_FINGER, Model
from ..values.stroke import Stroke
from .csv_tables import FORCE, SPEED_LAYOUT, Layout, RunsTable, TableError, read_measured
from .motion_profile import MotionProfile, profile_of
from .thesis import CLOSING_MS, FOAM_GRAMS, RIGID_GRAMS

GRAVITY: Final = 9.81  # m/s2, the thesis's value

LONGEST_S: Final = 600.0  # longest closing time that a table may contain
STRONGEST_N: Final = 1000.0  # strongest force that a table may contain

ScalePoints = tuple[tuple[int, float], ...]


@dataclass(frozen=True, slots=True)
class SpeedCalibration:
    """The meaning of speed values: closing times.

    Attributes:
        source: of the figures, for people.
        points: rising speed values, each with the seconds of a full closing.
        model: of the gripper; None where it is not known. Hands of another model refuse it.
        profile: the motion behind the figures, which separates the way from its start and end; None for
            closing times alone.
    """

    source: str
    points: ScalePoints
    model: Model | None = None
    profile: MotionProfile | None = field(default=None, repr=False)

    def __post_init__(self) -> None:
        """Check the points.

        Raises:
            TypeError: a value or a figure of the wrong type.
            ValueError: fewer than two, not rising, or outside 0..255 and 0..600 s.
        """
        object.__setattr__(self, "points", checked_points(self.points, LONGEST_S))
        _check_model(self.model)
        if not all(seconds for _, seconds in self.points):
            raise ValueError("points: a closing time must be above 0 s")

    @classmethod
    @cache
    def nominal(cls, model: Model = THREE_FINGER) -> SpeedCalibration:
        """The manual's figures, linear in between; of a 3-Finger 22 mm/s at 0 and 110 mm/s at 255."""
        slow, fast = model.speeds_mm_s
        times = ((value, model.stroke.mm / (slow + (fast - slow) * value / 255)) for value in range(256))
        return cls("nominal (manual)", tuple(times), model)

    @classmethod
    def usual(cls, model: Model) -> SpeedCalibration:
        """The figures that time moves: the thesis's for a 3-Finger, its motion profile's for a jaw."""
        profile = profile_of(model)
        return cls.thesis() if profile is None else cls._of_profile(model, profile)

    @classmethod
    @cache
    def _of_profile(cls, model: Model, profile: MotionProfile) -> SpeedCalibration:
        counts = model.stroke.counts
        times = tuple((value, profile.closing_s(counts, value)) for value in range(256))
        runs = f" ({profile.runs} motions)" if profile.runs else ""
        return cls(profile.source + runs, times, model, profile)

    @classmethod
    @cache
    def thesis(cls) -> SpeedCalibration:
        """The thesis's table A1.1: the mean of three runs for every fourth value."""
        return cls.from_table("thesis, table A1.1", CLOSING_MS, THREE_FINGER)

    @classmethod
    def from_csv(cls, path: Path | str) -> SpeedCalibration:
        """Your own table, as ``robotiq-async measure speed`` writes it.

        Raises:
            TableError: the file is not such a table, or has fewer than two rows.
        """
        table, model = _read_curve(path, SPEED_LAYOUT)
        if any(not all(runs) for runs in table.values()):
            raise TableError(path, None, "a closing takes longer than 0 ms")
        return cls.from_table(str(path), table, model)

    @classmethod
    def from_table(cls, source: str, table: RunsTable, model: Model | None = None) -> SpeedCalibration:
        """The calibration in a table of closing times in milliseconds."""
        return cls(source, tuple((value, mean(table[value]) / 1000) for value in sorted(table)), model)

    @property
    def stroke(self) -> Stroke:
        """The nominal stroke of the model; a 3-Finger's where it is not known."""
        return (self.model or THREE_FINGER).stroke

    def closing_time(self, speed: int) -> float:
        """Seconds of a full closing; linear between the points.

        Raises:
            TypeError: speed is not an int.
            ValueError: speed is outside 0..255, or outside the measured range.
        """
        return interpolated("speed", speed, self.points)

    def duration(self, counts: int, speed: int) -> float:
        """Seconds for a distance in counts, 0..255, at a speed value.

        Raises:
            TypeError: an argument is not an int.
            ValueError: an argument is outside 0..255, or the speed outside the measured range.
        """
        if self.profile is None:
            return check_byte("counts", counts) / self.stroke.counts * self.closing_time(speed)
        check_byte("speed", speed)
        return self.profile.closing_s(counts, speed) if check_byte("counts", counts) else 0.0

    def mm_per_s(self, speed: int) -> float:
        """Millimetres of opening a second: on the way if the figures tell it, else on average.

        Raises:
            TypeError: speed is not an int.
            ValueError: speed is outside 0..255, or outside the measured range.
        """
        return self.counts_per_s(speed) * self.stroke.mm / self.stroke.counts

    def counts_per_s(self, speed: int) -> float:
        """Counts a second, as :meth:`mm_per_s`.

        Raises:
            TypeError: speed is not an int.
            ValueError: speed is outside 0..255, or outside the measured range.
        """
        if self.profile is None:
            return self.stroke.counts / self.closing_time(speed)
        return self.profile.rates[check_byte("speed", speed)]

    def speed_value(self, mm_per_s: float) -> int:
        """The speed value closest to a speed.

        Raises:
            TypeError: not a number.
            ValueError: slower or faster than any value, and than the manual's range for this model.
        """
        figures = self.rates()
        return figures.nearest(check_number("mm_per_s", mm_per_s, *figures.limits))

    def rates(self) -> Figures:
        """The millimetres a second of each value; a gripper's own need not reach the ends of its manual's."""
        nominal = () if self.profile is None or self.model is None else self.model.speeds_mm_s
        return Figures({value: self.mm_per_s(value) for value in covered(self.points)}, nominal)


@dataclass(frozen=True, slots=True)
class ForceCalibration:
    """The rough meaning of force values in newtons; see the module.

    Attributes:
        source: of the figures, for people.
        points: rising force values, each with newtons.
        model: of the gripper; None where it is not known. Hands of another model refuse it.
    """

    source: str
    points: ScalePoints
    model: Model | None = None

    def __post_init__(self) -> None:
        """Check the points.

        Raises:
            TypeError: a value or a figure of the wrong type.
            ValueError: fewer than two, not rising, or outside 0..255 and 0..1000 N.
        """
        object.__setattr__(self, "points", checked_points(self.points, STRONGEST_N))
        _check_model(self.model)

    @classmethod
    def nominal(cls, model: Model = THREE_FINGER) -> ForceCalibration:
        """The manual's two figures joined by a straight line, although it calls the curve not linear."""
        weakest, strongest = model.forces_n
        return cls("nominal (manual)", ((0, weakest), (255, strongest)), model)

    @classmethod
    def thesis(cls, surface: str) -> ForceCalibration:
        """Readings of the thesis's scale: the mean of three runs, with foam around it or rigid.

        Args:
            surface: "foam" or "rigid".

        Raises:
            ValueError: another surface.
        """
        if surface not in ("foam", "rigid"):
            raise ValueError(f"surface must be 'foam' or 'rigid', got {surface!r}")
        table = FOAM_GRAMS if surface == "foam" else RIGID_GRAMS
        return cls.from_table(f"thesis, {surface}", table, THREE_FINGER)

    @classmethod
    def from_csv(cls, path: Path | str) -> ForceCalibration:
        """Your own table, as ``robotiq-async measure force`` writes it.

        Raises:
            TableError: the file is not such a table, or has fewer than two rows.
        """
        return cls.from_table(str(path), *_read_curve(path, FORCE))

    @classmethod
    def from_table(cls, source: str, table: RunsTable, model: Model | None = None) -> ForceCalibration:
        """The calibration in a table of scale readings in grams."""
        return cls(source, tuple((value, newton(mean(table[value]))) for value in sorted(table)), model)

    def newton(self, force: int) -> float:
        """Newtons at a force value; linear between the points.

        Raises:
            TypeError: force is not an int.
            ValueError: force is outside 0..255, or outside the measured range.
        """
        return interpolated("force", force, self.points)

    def force_value(self, newton: float) -> int:
        """The force value closest to a force, the lowest of several.

        Raises:
            TypeError: not a number.
            ValueError: weaker or stronger than any value.
        """
        figures = Figures({value: self.newton(value) for value in covered(self.points)})
        return figures.nearest(check_number("newton", newton, figures.low, figures.high))


def _read_curve(path: Path | str, layout: Layout) -> tuple[RunsTable, Model | None]:
    """Read a table of at least two rows, and its model."""
    table, model = read_measured(path, layout)
    if len(table) < 2:
        values = f"{layout.value.replace('_', ' ')}s"
        raise TableError(path, None, f"at least two {values} are needed, got {len(table)}")
    return table, model


def mean(runs: Sequence[int]) -> float:
    """The mean of a row's runs."""
    return sum(runs) / len(runs)


def newton(grams: float) -> float:
    """The force, in newtons, that a scale shows as a mass: F = m g."""
    return grams / 1000 * GRAVITY


def _check_model(model: object) -> None:
    if model is not None and not isinstance(model, Model):
        raise TypeError(f"model must be a Model or None, got {model!r}")


def checked_points(given: Iterable[tuple[int, float]], high: float) -> ScalePoints:
    """Copy points into tuples of plain numbers, and check that they form a curve."""
    points = tuple(
        (check_byte("a value of points", value), check_number("a figure of points", figure, 0.0, high))
        for value, figure in given
    )
    if len(points) < 2:
        raise ValueError(f"points: at least two are needed, got {len(points)}")
    values = [value for value, _ in points]
    if values != sorted(set(values)):
        raise ValueError(f"points: the values must rise, got {values}")
    return points


def covered(points: ScalePoints) -> range:
    """The values between the first and the last point."""
    return range(points[0][0], points[-1][0] + 1)


def interpolated(name: str, value: int, points: Sequence[tuple[int, float]]) -> float:
    """The figure at a value, on the straight line between its neighbours."""
    low, high = points[0][0], points[-1][0]
    value = check_byte(name, value)
    if not low <= value <= high:
        raise ValueError(f"{name} {value} lies outside the measured range: {low}..{high}")
    after = min(bisect_right(points, value, key=lambda point: point[0]), len(points) - 1)
    (left, at_left), (right, at_right) = points[after - 1], points[after]
    return at_left + (at_right - at_left) * (value - left) / (right - left)


def outwards(low: float, high: float) -> tuple[float, float]:
    """A range to two digits, rounded so that it loses no value."""
    return floor(low * 100) / 100, ceil(high * 100) / 100


class Figures:
    """The figures of values, in order, to find the closest value quickly: control loops do so in every cycle.

    Attributes:
        low: the lowest figure.
        high: the highest figure.
        limits: the lowest and highest that are accepted, rounded outwards to two digits: a limit copied from
            a message is accepted.
    """

    __slots__ = ("_figures", "_values", "high", "limits", "low")

    def __init__(self, figures: Mapping[int, float], accepted: Sequence[float] = ()) -> None:
        lowest: dict[float, int] = {}  # the lowest value of each figure
        for value in sorted(figures):
            lowest.setdefault(figures[value], value)
        self._figures = sorted(lowest)
        self._values = [lowest[figure] for figure in self._figures]
        self.low: float = self._figures[0]
        self.high: float = self._figures[-1]
        self.limits: tuple[float, float] = outwards(min((self.low, *accepted)), max((self.high, *accepted)))

    def nearest(self, wanted: float) -> int:
        """The value with the closest figure, the lowest of several."""
        figures, values = self._figures, self._values
        after = bisect_left(figures, wanted, 1, len(figures) - 1) if len(figures) > 1 else 0
        before = max(after - 1, 0)
        nearer = (wanted - figures[before]) - (figures[after] - wanted)
        if not nearer:
            return min(values[before], values[after])
        return values[before] if nearer < 0 else values[after]


_THESIS: Final = SpeedCalibration.thesis()


def closing_time(speed: int) -> float:
    """Seconds of a full closing at a speed value, as the thesis measured it: three runs, within 2 %."""
    return _THESIS.closing_time(speed)
