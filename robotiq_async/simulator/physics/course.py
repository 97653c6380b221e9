"""Course: the positions of an axis over time, as straight lines."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

if TYPE_CHECKING:
    from robotiq_async.calibration.motion_profile import MotionProfile

_LEFT_TO_PRESS: Final = 0.51
"""Counts that are left when an axis begins to press: the last count of its reading is yet to come."""
_LAST_COUNT: Final = 0.5
"""Share of its pressing after which the last count comes, if that is before the report."""
_EARLIEST: Final = 0.8
"""The report of a contact comes early by at most this share of the pressing."""


class Knot(NamedTuple):
    """A position at a time."""

    time: float
    position: float


class AxisCourse:
    """A way of straight lines, at rest before and after it. Times are seconds, positions counts. Immutable.

    Attributes:
        origin: the position before it.
        end: the position after it.
        moves_at: the time at which it begins to move.
        presses_at: the time at which it begins to press against something; infinite if it does not.
        ends_at: the time at which its end is reported; infinite if it is a rest.
    """

    __slots__ = ("_knots", "end", "ends_at", "moves_at", "origin", "presses_at")

    def __init__(
        self, knots: tuple[Knot, ...], *, presses_at: float = math.inf, ends_at: float = math.inf
    ) -> None:
        self._knots = knots
        self.moves_at: float
        self.origin: float
        self.moves_at, self.origin = knots[0]
        self.end: float = knots[-1].position
        self.presses_at: float = presses_at
        self.ends_at: float = ends_at

    def position(self, time: float) -> float:
        begin, at_begin = self._knots[0]
        for knot in self._knots:
            when, at = knot
            if time < when:
                if at == at_begin:
                    return at
                return at_begin + (at - at_begin) * max(0.0, time - begin) / (when - begin)
            begin, at_begin = when, at
        return self.end


def rest(time: float, position: float) -> AxisCourse:
    """The course of an axis that stays where it is."""
    return AxisCourse((Knot(time, position),))


def straight(time: float, here: float, end: float, rate: float, pressing: float) -> AxisCourse:
    """One straight line, and pressing for some seconds before the end is reported."""
    arrives = time + abs(end - here) / rate
    presses_at = arrives if pressing else math.inf
    return AxisCourse(
        (Knot(time, here), Knot(arrives, end)), presses_at=presses_at, ends_at=arrives + pressing
    )


def of_a_jaw(
    time: float,
    here: float,
    end: float,
    rate: float,
    profile: MotionProfile,
    *,
    lands: bool,
    presses: bool,
    early: float,
) -> AxisCourse:
    """The motion of a jaw from the time at which it begins to move.

    Args:
        time: of its begin.
        here: position then.
        end: position after it.
        rate: counts a second on the way.
        profile: its figures.
        lands: it slows down before an end stop.
        presses: it presses before its end is reported.
        early: seconds before the last count at which the end is reported; 0: after it.
    """
    way = abs(end - here)
    sign = math.copysign(1.0, end - here)
    landing = min(profile.landing, way) if lands else 0.0
    short = min(_LEFT_TO_PRESS, way) if presses else 0.0
    knots = [Knot(time, here)]
    if landing > short:
        time += (way - landing) / rate
        knots.append(Knot(time, end - sign * landing))
        time += landing / min(profile.slowest, rate)
    else:
        time += way / rate
    knots.append(Knot(time, end - sign * short))
    if not presses:
        return AxisCourse(tuple(knots), ends_at=time)
    pressing = profile.pressing_time(rate)
    ends_at = time + pressing - min(early, _EARLIEST * pressing)
    last = time + pressing * (1.0 if early else _LAST_COUNT)
    knots += Knot(last, end - sign * short), Knot(last, end)
    return AxisCourse(tuple(knots), presses_at=time, ends_at=ends_at)
