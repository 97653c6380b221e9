"""One motorised axis: straight lines in time, mechanical stops and obstacles.

An axis never integrates in steps. It keeps where and when its present motion began, how fast it is and where
it ends; everything else is computed. That makes a result independent of how often somebody looks.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.closing_time import STROKE_COUNTS, closing_time
from robotiq_async.enums import ObjectStatus

if TYPE_CHECKING:
    from robotiq_async.request import AxisRequest

# Plausible figures in counts of 10 mA. The only published one is the manual's example of a reading, 0x0F.
_MOVING_CURRENT: Final = 8.0
_MOVING_CURRENT_PER_RATE: Final = 0.1
_GRIPPING_CURRENT: Final = 20.0
_GRIPPING_CURRENT_PER_FORCE: Final = 0.3


class Obstacle(NamedTuple):
    """Something in the way of an axis.

    Attributes:
        position: the count at which the axis touches it.
        soft: counts by which a force of 255 presses the axis into it; less force, proportionally less.
    """

    position: int
    soft: int = 0


class Axis:
    """A finger or the scissor.

    Times are simulated seconds, positions counts. Methods that take a time must be called with times that do
    not decrease and never jump over :attr:`ends_at`; the end of a motion is told by :meth:`arrive`.

    Attributes:
        low: where the opening motion ends mechanically, in counts.
        high: where the closing motion ends mechanically, in counts.
        status: what gDT says about the axis while gGTO = 1.
        ends_at: when the present motion ends; infinite at rest.
        in_closing: the obstacle met while closing, if there is one.
        in_opening: the obstacle met while opening, if there is one.
    """

    def __init__(self, position: int, low: int, high: int) -> None:
        """An axis at rest."""
        self.low = low
        self.high = high
        self.status = ObjectStatus.IN_MOTION
        self.ends_at = math.inf
        self.in_closing: Obstacle | None = None
        self.in_opening: Obstacle | None = None
        self._goal: AxisRequest | None = None
        self._origin = float(position)
        self._since = 0.0
        self._stop = float(position)
        self._rate = 0.0
        self._outcome = ObjectStatus.IN_MOTION
        self._travelled = 0.0

    @property
    def is_moving(self) -> bool:
        """Whether the axis moves."""
        return self.ends_at < math.inf

    @property
    def target(self) -> int:
        """Where the axis is driven to, in counts within its stops; at rest without a goal, where it is."""
        return round(self._origin) if self._goal is None else self._within_stops(self._goal.position)

    def position(self, time: float) -> float:
        """Where the axis is."""
        if not self.is_moving:
            return self._origin
        return self._origin + math.copysign(self._rate * (time - self._since), self._stop - self._origin)

    def travel(self, time: float) -> float:
        """The way the axis has gone since it was made, in counts, forth and back added up."""
        return self._travelled + abs(self.position(time) - self._origin)

    @property
    def current(self) -> int:
        """Motor current in counts. It grows with the speed of a motion and with the force of a contact."""
        if self.is_moving:
            return round(_MOVING_CURRENT + _MOVING_CURRENT_PER_RATE * self._rate)
        if self.status.is_contact and self._goal is not None:
            return round(_GRIPPING_CURRENT + _GRIPPING_CURRENT_PER_FORCE * self._goal.force)
        return 0

    def command(self, time: float, goal: AxisRequest) -> None:
        """Go to a position; repeating a goal changes nothing.

        A contact latches, for the obstacle is still there: a goal beyond it leaves the axis where it is, or
        with more force presses it deeper into something soft.
        """
        if goal != self._goal:
            self._goal = goal
            self.plan(time)

    def hold(self, time: float) -> None:
        """Stop on the count the axis reads now, and forget the goal."""
        self._rest(time, float(round(self.position(time))))
        self._goal = None

    def clear(self, time: float) -> None:
        """Stop like :meth:`hold`, and forget what was touched or reached."""
        self.hold(time)
        self.status = ObjectStatus.IN_MOTION

    def arrive(self) -> None:
        """End the present motion; to be called at :attr:`ends_at`."""
        self._rest(self.ends_at, self._stop)
        self.status = self._outcome

    def plan(self, time: float) -> None:
        """Begin the motion from here to the goal, if there is one; to be called when obstacles change."""
        if self._goal is None:
            return
        here = self.position(time)
        self._rest(time, here)
        self._stop, self._outcome = self._end_of_the_way(here, self._goal)
        if self._stop == here:
            self.status = self._outcome
            return
        self.status = ObjectStatus.IN_MOTION
        self._rate = STROKE_COUNTS / closing_time(self._goal.speed)
        self.ends_at = time + abs(self._stop - here) / self._rate

    def _end_of_the_way(self, here: float, goal: AxisRequest) -> tuple[float, ObjectStatus]:
        """Where the motion from here to the goal ends, and why.

        An obstacle that the axis has passed already is behind it and no contact.
        """
        target = self._within_stops(goal.position)
        if self.in_closing is not None and here <= self.in_closing.position + self.in_closing.soft:
            touching = max(here, self.in_closing.position + _dent(self.in_closing, goal.force))
            if touching < target:
                return touching, ObjectStatus.CONTACT_CLOSING
        if self.in_opening is not None and here >= self.in_opening.position - self.in_opening.soft:
            touching = min(here, self.in_opening.position - _dent(self.in_opening, goal.force))
            if touching > target:
                return touching, ObjectStatus.CONTACT_OPENING
        return target, ObjectStatus.AT_POSITION

    def _within_stops(self, position: int) -> int:
        return max(self.low, min(self.high, position))

    def _rest(self, time: float, position: float) -> None:
        """Stand still at a position, with the way up to it accounted for."""
        self._travelled += abs(position - self._origin)
        self._origin = position
        self._since = time
        self.ends_at = math.inf


def _dent(obstacle: Obstacle, force: int) -> int:
    return round(obstacle.soft * force / 255)
