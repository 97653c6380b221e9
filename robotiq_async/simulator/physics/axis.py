"""One motorised axis: straight lines in time, mechanical stops and obstacles.

An axis never integrates in steps. It keeps the place and time at which its present motion began, its speed
and its end; everything else is computed. So the result does not depend on how often it is read.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.values.enums import SPEED_MAX, ObjectStatus

if TYPE_CHECKING:
    from robotiq_async.values.calibration.scales import SpeedCalibration

    from .spread import Spread

PRESSING: Final = 0.05
"""Seconds for which an axis presses, still reported as motion, before it reports the contact. No source gives
this time; it is ten polls."""

# The current of an axis's motor, in counts of 10 mA.
#
# Published are the frames of the manual's worked grasp (2014, pp. 69-74): at full speed A, B and C close with
# 0x0F, 0x10 and 0x0F and open with 0x0B, 0x0E and 0x0B; at rest they draw nothing, be they open or holding
# something with full force, for they lock themselves.
#
# The rest is made up to fit: the current of a slower motion, the scissor (taken for finger A), and the peak
# of a contact. By the manual the force fixes the highest current of a motion (2014, p. 47); by the thesis
# (figures 13 to 15, without numbers) the peak grows with the force, at once on something rigid and bit by bit
# in foam.
_SHARE_OF_FRICTION: Final = 0.5
# Above what the fastest motion draws, or it would stop itself; three fingers at once stay within the 1.5 A
# that the manual lets the whole gripper take.
_WEAKEST_PEAK: Final = 20
_STRONGEST_PEAK: Final = 50


class Motor(NamedTuple):
    """The motor of one axis.

    Attributes:
        closing: current while closing at full speed.
        opening: current while opening at full speed.
    """

    closing: int
    opening: int

    def running(self, share: float, *, closing: bool) -> float:
        """Current in free motion, at a share of the full speed."""
        full = self.closing if closing else self.opening
        return full * (_SHARE_OF_FRICTION + (1 - _SHARE_OF_FRICTION) * share)


MOTORS: Final = (Motor(15, 11), Motor(16, 14), Motor(15, 11), Motor(15, 11))
"""The motors of A, B, C and the scissor."""


def peak(force: int) -> float:
    """Current when the axis stops at something: the most that the force, 0..255, allows."""
    return _WEAKEST_PEAK + (_STRONGEST_PEAK - _WEAKEST_PEAK) * force / 255


class Goal(NamedTuple):
    """The target of an axis with its speed and force, in counts.

    Attributes:
        position: the target.
        speed: 0..255.
        force: 0..255.
        is_reading: the axis ends exactly at the position, without the spread of a request.
        stroke_time: seconds of a full stroke, if not those of the speed.
        clears: obstacles that are not fixed do not count.
    """

    position: int
    speed: int
    force: int
    is_reading: bool = False
    stroke_time: float = 0.0
    clears: bool = False

    def rate(self, speeds: SpeedCalibration) -> float:
        """Counts a second."""
        return speeds.stroke.counts / (self.stroke_time or speeds.closing_time(self.speed))


class Obstacle(NamedTuple):
    """Something in the way of an axis.

    Attributes:
        position: the count at which the axis touches it.
        soft: counts by which a force of 255 presses the axis into it; less force, proportionally less.
        fixed: whether it stays in place during an activation; others are removed and put back.
    """

    position: int
    soft: int = 0
    fixed: bool = False


class _Path(NamedTuple):
    """A planned path: its end, the outcome there, and the surface of the obstacle that ends it."""

    end: float
    outcome: ObjectStatus
    surface: float = math.nan


class Axis:
    """A finger or the scissor.

    Times are simulated seconds, positions counts. Methods that take a time must be called with times that do
    not decrease and never skip :attr:`ends_at`; call :meth:`arrive` at that time.

    Attributes:
        low: the end of the opening motion, in counts.
        high: the end of the closing motion, in counts; :meth:`confine` changes it.
        status: gDT of the axis while gGTO = 1.
        ends_at: the time at which the present motion ends; infinite at rest.
        in_closing: the obstacle met while closing, if there is one.
        in_opening: the obstacle met while opening, if there is one.
    """

    def __init__(
        self, position: int, low: int, high: int, motor: Motor, spread: Spread, speeds: SpeedCalibration
    ) -> None:
        self.low = low
        self.high = high
        self.status = ObjectStatus.IN_MOTION
        self.ends_at = math.inf
        self.in_closing: Obstacle | None = None
        self.in_opening: Obstacle | None = None
        self._motor = motor
        self._spread = spread
        self._speeds = speeds
        self._full_rate = speeds.stroke.counts / speeds.closing_time(SPEED_MAX)
        self._closed = high
        self._goal: Goal | None = None
        self._is_locked = False
        """Whether it was stopped in a grip and still holds, without a goal."""
        self._origin = float(position)
        self._since = 0.0
        self._path = _Path(self._origin, ObjectStatus.IN_MOTION)
        self._rate = self._running = self._peak = 0.0
        self._travelled = 0.0

    @property
    def is_moving(self) -> bool:
        """Whether the axis moves, or presses against something before it reports the contact."""
        return self.ends_at < math.inf

    @property
    def grips(self) -> bool:
        return self._goal is not None and self._is_latched_against(self._goal)

    @property
    def holds(self) -> bool:
        """Whether the axis grips, or did when it was stopped and has locked itself."""
        return self.grips or self._is_locked

    @property
    def target(self) -> int:
        """The target of the axis in counts, within its stops; at rest without a goal, its position."""
        return round(self._origin) if self._goal is None else self.within_stops(self._goal.position)

    def position(self, time: float) -> float:
        if not self.is_moving:
            return self._origin
        distance = self._path.end - self._origin
        return self._origin + math.copysign(min(self._rate * (time - self._since), abs(distance)), distance)

    def travel(self, time: float) -> float:
        """The distance travelled so far, in counts, in both directions."""
        return self._travelled + abs(self.position(time) - self._origin)

    def within_stops(self, position: int) -> int:
        """The count nearest to a position that the axis can be at."""
        return max(self.low, min(self.high, position))

    def current(self, time: float) -> int:
        """Motor current in counts: that of the motion, up to the peak of a contact, and 0 at rest."""
        if not self.is_moving:
            return 0
        return round(self._running + (self._peak - self._running) * self._pressed(time))

    def command(self, time: float, goal: Goal) -> None:
        """Go to a position; repeating a goal changes nothing.

        A contact latches: a goal beyond it with no more force leaves the axis where it is. With more force it
        tries again, and presses deeper into something soft.
        """
        if goal == self._goal:
            return
        is_latched = self._is_latched_against(goal)
        self._goal, self._is_locked = goal, False
        if not is_latched:
            self._plan(time)

    def hold(self, time: float, *, locks: bool) -> None:
        """Stop at the present count and forget the goal. An axis that ``locks`` keeps its grip."""
        self._is_locked = locks and self.holds
        self._rest(time, float(round(self.position(time))))
        self._goal = None

    def clear(self, time: float) -> None:
        self.hold(time, locks=False)
        self.status = ObjectStatus.IN_MOTION

    def arrive(self) -> None:
        """End the present motion; to be called at :attr:`ends_at`."""
        self._rest(self.ends_at, self._path.end)
        self.status = self._path.outcome

    def confine(self, time: float, high: int | None) -> None:
        """Let the closing motion end at a software limit, or with None at the mechanical stop."""
        before, self.high = self.high, self._closed if high is None else high
        if self.high != before and self._goal is not None and not self._is_latched_against(self._goal):
            self._plan(time)

    def look_again(self, time: float) -> None:
        """Plan the motion again after obstacles have changed. An axis at rest does not: a contact latches."""
        if self.is_moving:
            self._plan(time)

    def _plan(self, time: float) -> None:
        assert self._goal is not None, "only a motion with a goal is planned"
        here, before, due = self.position(time), self._path, self.ends_at
        self._path = self._path_to(here, self._goal)
        reached = self._has_reached(here, self._goal)
        self._rest(time, here)
        if reached:
            self.status = ObjectStatus.AT_POSITION
            return
        self.status = ObjectStatus.IN_MOTION
        self._rate = self._goal.rate(self._speeds)
        self._running = self._motor.running(self._rate / self._full_rate, closing=self._path.end > here)
        self._peak = peak(self._goal.force)
        self.ends_at = time + abs(self._path.end - here) / self._rate
        if self._path.outcome.is_contact:
            # A new request does not restart the pressing.
            presses = due < math.inf and here == before.end and self._path == before
            self.ends_at = due if presses else self.ends_at + PRESSING

    def _path_to(self, here: float, goal: Goal) -> _Path:
        # Multiplied by the sign, both directions compare like a closing motion.
        target = self.within_stops(goal.position)
        sign = 1 if target > here else -1
        end = self.within_stops(target + sign * self._overshoot(goal))
        obstacle = self.in_closing if sign > 0 else self.in_opening
        if obstacle is None or (goal.clears and not obstacle.fixed):
            return _Path(end, ObjectStatus.AT_POSITION)
        surface = obstacle.position + self._spread.contact(obstacle.position)
        far_side = max(sign * obstacle.position, sign * surface) + obstacle.soft + self._spread.tolerance
        if sign * here > far_side:  # the axis has passed the obstacle
            return _Path(end, ObjectStatus.AT_POSITION)
        dent = round(obstacle.soft * goal.force / 255)
        stopped = sign * max(sign * here, sign * surface + dent)
        if sign * stopped < sign * target:
            contact = ObjectStatus.CONTACT_CLOSING if sign > 0 else ObjectStatus.CONTACT_OPENING
            return _Path(stopped, contact, surface)
        return _Path(sign * min(sign * end, sign * stopped), ObjectStatus.AT_POSITION)

    def _overshoot(self, goal: Goal) -> int:
        """Counts by which the axis will overshoot: none at a stop, or if the goal is a reading."""
        if goal.is_reading or not self.low < goal.position < self.high:
            return 0
        return self._spread.overshoot(goal.position)

    def _has_reached(self, here: float, goal: Goal) -> bool:
        """Whether the axis need not move: an axis at rest within its tolerance has arrived."""
        if self._path.outcome is not ObjectStatus.AT_POSITION:
            return False
        tolerance = 0 if goal.is_reading or self.is_moving else self._spread.tolerance
        return self._path.end == here or abs(goal.position - here) <= tolerance

    def _is_latched_against(self, goal: Goal) -> bool:
        """Whether the axis is in a contact, and the goal lies beyond it with no more force."""
        if self._goal is None or self.is_moving or goal.force > self._goal.force:
            return False
        beyond = self.within_stops(goal.position) - self._origin
        return (self.status is ObjectStatus.CONTACT_CLOSING and beyond > 0) or (
            self.status is ObjectStatus.CONTACT_OPENING and beyond < 0
        )

    def _pressed(self, time: float) -> float:
        """The share of its way into the obstacle that the axis has been pressed, 0..1."""
        _, outcome, surface = path = self._path
        if not outcome.is_contact:
            return 0.0
        position = self.position(time)
        if position == path.end:
            return 1.0
        return 0.0 if path.end == surface else max(0.0, (position - surface) / (path.end - surface))

    def _rest(self, time: float, position: float) -> None:
        self._travelled += abs(position - self._origin)
        self._origin = position
        self._since = time
        self.ends_at = math.inf
