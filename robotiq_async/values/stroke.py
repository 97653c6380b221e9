"""Stroke: the opening at a position in counts.

Openings are nominal: no table that someone measured on a 2F or a Hand-E is published, and nothing here has
run on real hardware. A gripper reads a few counts when it is open and less than 255 when it is closed. In
between the opening follows

* a straight line for a Hand-E, whose fingers move in parallel, and for a finger of a 3-Finger, because the
  manual gives nothing better;
* the arc of a four-bar linkage for a 2F: a pad is carried by a link that turns, by an angle taken to be
  linear in counts. In the middle the opening is 3.3 % of the stroke more than on a straight line, 2.8 mm of
  85.

Points that were measured on a gripper replace the ends and the figures. Between two of them the nominal shape
is stretched, so that two points, open and closed, keep it.
"""

from __future__ import annotations

import operator
from bisect import bisect_left
from collections.abc import Iterable
from dataclasses import dataclass, field
from functools import lru_cache
from itertools import pairwise
from math import cos
from typing import Final

from .checks import check_byte, check_number, repr_of

WIDEST_MM: Final = 1000.0  # widest opening that a point may have
LEAST_FALL_MM: Final = 0.02
"""The least that a measured opening falls in a count. Nominal ones fall by 0.2 and more, with any
fingertips: less is a slip of the calliper or of the pen. And a position could not be found again by its
opening, which is kept to 0.01 mm."""

Point = tuple[int, float]
Points = tuple[Point, ...]


@dataclass(frozen=True, slots=True)
class Stroke:
    """The openings of a gripper from open to closed. Immutable.

    Attributes:
        mm: the opening of an open gripper, in millimetres.
        open_reading: position, in counts, that an open finger reads.
        closed_reading: position, in counts, that a closed finger reads.
        arc: radians of the link that carries a pad, against the direction of closing: its angle when open,
            and its turn; None for a straight line.
        points: positions with their openings that were measured on one gripper; empty for nominal figures.
        openings: the opening at each position 0..255, in millimetres, to 0.01 mm: a count is 20 times that.
        fractions: the same as a share of the travel in counts, 1 (open) .. 0 (closed), to 0.0001.
    """

    mm: float
    open_reading: int
    closed_reading: int
    arc: tuple[float, float] | None = None
    points: Points = ()
    # Worked out once: control loops convert at every poll.
    openings: tuple[float, ...] = field(init=False, repr=False, compare=False)
    fractions: tuple[float, ...] = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        # Requests beyond the end stops are legal; the finger ends at the stop.
        inside = [min(max(each, self.open_reading), self.closed_reading) for each in range(256)]
        keep = object.__setattr__
        keep(
            self, "fractions", tuple(round((self.closed_reading - each) / self.counts, 4) for each in inside)
        )
        keep(self, "openings", tuple(round(self._opening(each), 2) for each in inside))

    def __reduce__(self) -> tuple[object, ...]:
        return Stroke, (self.mm, self.open_reading, self.closed_reading, self.arc, self.points)

    @property
    def counts(self) -> int:
        """Counts of a full closing."""
        return self.closed_reading - self.open_reading

    @property
    def closed_mm(self) -> float:
        """The opening of a closed gripper: 0 without measured points."""
        return self._knots[-1][1]

    @property
    def source(self) -> str:
        """The source of the openings, for people."""
        return "measured" if self.points else "nominal"

    @lru_cache(maxsize=16)  # noqa: B019  # a remote hand calls this at every status
    def measured(self, points: Points) -> Stroke:
        """The stroke of one gripper, from points as :func:`check_points` returns them; itself without any."""
        if not points:
            return self
        (first, mm), (last, _) = points[0], points[-1]
        return Stroke(mm, first, last, self.arc, points)

    def opening_mm(self, position: int) -> float:
        """The opening at a position: the widest up to the open reading, the least from the closed reading on.

        Raises:
            TypeError: position is not an int.
            ValueError: position is outside 0..255.
        """
        return self.openings[check_byte("position", position)]

    def open_fraction(self, position: int) -> float:
        """The share of the travel that is open, linear in counts: 1 (open) .. 0 (closed).

        Raises:
            TypeError: position is not an int.
            ValueError: position is outside 0..255.
        """
        return self.fractions[check_byte("position", position)]

    def position_of(self, mm: float) -> int:
        """The position, in counts, closest to an opening.

        Raises:
            TypeError: not a number.
            ValueError: outside the openings of this gripper, 0 (closed) .. ``mm`` (open) unless measured.
        """
        # An opening that was read is accepted, too: it is rounded, perhaps to beyond the measured end.
        least, most = min(self.closed_mm, self.openings[-1]), max(self.mm, self.openings[0])
        wanted = check_number("mm", mm, least, most, "millimetres")
        # Openings fall from the open reading to the closed one.
        low, high = self.open_reading, self.closed_reading
        after = bisect_left(self.openings, -wanted, low, high, key=operator.neg)
        if after > low and self.openings[after - 1] - wanted < wanted - self.openings[after]:
            return after - 1
        return after

    def position_at(self, open_fraction: float) -> int:
        """The position, in counts, closest to a share of the travel.

        The ends are as of ``open()`` and ``close()``: 1 is 0 counts, and 0 is 255, which presses.

        Raises:
            TypeError: not a number.
            ValueError: outside 0 (closed) .. 1 (open).
        """
        share = check_number("open_fraction", open_fraction, 0.0, 1.0, "a share, closed to open,")
        if share in (0.0, 1.0):
            return 0 if share else 255
        return round(self.closed_reading - share * self.counts)

    @property
    def _knots(self) -> Points:
        return self.points or ((self.open_reading, self.mm), (self.closed_reading, 0.0))

    def _opening(self, position: int) -> float:
        """The opening at a position from the open to the closed reading."""
        for (left, at_left), (right, at_right) in pairwise(self._knots):
            if position <= right:
                begin, end = self._shape(left), self._shape(right)
                return at_right + (at_left - at_right) * (self._shape(position) - end) / (begin - end)
        raise AssertionError("the last point is the closed reading")

    def _shape(self, position: int) -> float:
        """The nominal opening at a position, on any scale."""
        travelled = (position - self.open_reading) / self.counts
        if self.arc is None:
            return -travelled
        angle, turn = self.arc
        return cos(angle + turn * travelled)


def check_points(name: str, given: object) -> Points:
    """Points of a stroke: positions that rise from open to closed, each with an opening that falls.

    Raises:
        TypeError: not a sequence of pairs of an int and a number.
        ValueError: fewer than two, a position outside 0..255, an opening outside 0..1000 mm, not in order, or
            an opening that falls by less than 0.02 mm a count.
    """
    form = f"{name} must be two or more points (position in counts, opening in mm)"
    if not isinstance(given, Iterable) or isinstance(given, str | bytes):
        raise TypeError(f"{form}, got {repr_of(given):.100}")
    pairs = [tuple(each) if isinstance(each, list | tuple) else () for each in given]
    if len(pairs) < 2 or any(len(each) != 2 for each in pairs):
        raise ValueError(f"{form}, got {repr_of(given):.100}")
    points = tuple(
        (
            check_byte(f"a position of {name}", position),
            check_number(f"an opening of {name}", mm, 0.0, WIDEST_MM, "millimetres"),
        )
        for position, mm in pairs
    )
    for before, after in pairwise(points):
        if why := why_not_after(before, after):
            raise ValueError(f"{name}: {why}")
    return points


def why_not_after(before: Point, after: Point) -> str:
    """The reason why a measured point cannot follow another; empty if it can."""
    (position, wider), (further, narrower) = before, after
    got = f"got {wider:g} mm at {position} and then {narrower:g} mm at {further}"
    if not (position < further and wider > narrower):
        return f"positions must rise and openings fall, {got}"
    if wider - narrower < LEAST_FALL_MM * (further - position):
        return f"an opening must fall by {LEAST_FALL_MM:g} mm a count or more, {got}"
    return ""
