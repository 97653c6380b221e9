"""One motorised axis: its course in time, mechanical stops and obstacles.

An axis never integrates in steps. A motion is planned once, as a :class:`~.course.Course` of straight lines;
everything else is computed from it. So the result does not depend on how often it is read.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple

from robotiq_async.calibration.motion_profile import GOES_ON_S
from robotiq_async.values.enums import SPEED_MAX, ObjectStatus

from .course import AxisCourse, of_a_jaw, rest, straight

if TYPE_CHECKING:
    from robotiq_async.calibration.motion_profile import MotionProfile

    from .spread import Spread

# The current of an axis's motor, in counts of 10 mA.
#
# Published are the frames of the manual's worked grasp (2014, pp. 69-74): at full speed A, B and C close with
# 0x0F, 0x10 and 0x0F and open with 0x0B, 0x0E and 0x0B; at rest they draw nothing, be they open or holding
# something with full force, for they lock themselves.
#
# The rest is made up to fit: the current of a slower motion, the scissor (taken for finger A), and the peak
# of a contact. The manual says that the force fixes the highest current of a motion (2014, p. 47); in the
# thesis (figures 13 to 15, without numbers) the peak grows with the force, at once on something rigid and bit
# by bit in foam.
_SHARE_OF_FRICTION: Final = 0.5
# Above the current of the fastest motion, or it would stop itself; three fingers at once stay within the
# 1.5 A that the manual lets the whole gripper take.
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
        rate: counts a second, if the speed does not decide them.
        clears: obstacles that are not fixed do not count.
    """

    position: int
    speed: int
    force: int
    is_reading: bool = False
    rate: float = 0.0
    clears: bool = False

    def rate_of(self, motion: MotionProfile) -> float:
        """Counts a second on the way."""
        return self.rate or motion.rates[self.speed]


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
        high: the end of the closing motion at the greatest force, in counts; :meth:`confine` changes it.
        status: gDT of the axis while gGTO = 1.
        ends_at: the time at which the present motion ends; infinite at rest.
        in_closing: the obstacle met while closing, if there is one.
        in_opening: the obstacle met while opening, if there is one.
    """

    def __init__(
        self, position: int, low: int, high: int, motor: Motor, spread: Spread, motion: MotionProfile
    ) -> None:
        self.low = low
        self.high: int = high
        self.status: ObjectStatus = ObjectStatus.IN_MOTION
        self.ends_at: float = math.inf
        self.in_closing: Obstacle | None = None
        self.in_opening: Obstacle | None = None
        self._motor = motor
        self._spread = spread
        self._motion = motion
        self._most_give = motion.give_at(SPEED_MAX, motion.fastest)
        self._closed = high
        self._goal: Goal | None = None
        self._is_locked = False
        """Whether it was stopped in a grip and still holds, without a goal."""
        self._course = rest(0.0, float(position))
        self._path = _Path(float(position), ObjectStatus.IN_MOTION)
        self._running = self._peak = 0.0
        self._travelled = 0.0
        self._moved_at = -math.inf
        """When it last came to rest."""
        self._closes = False
        """Whether the last motion closes."""
        self._contacts = 0
        """Contacts so far: no two of them read the same."""

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
        if self._goal is None:
            return round(self._course.end)
        return self._target(self._course.end, self._goal)

    def position(self, time: float) -> float:
        return self._course.position(time)

    def travel(self, time: float) -> float:
        """The distance travelled so far, in counts, in both directions."""
        return self._travelled + abs(self._course.position(time) - self._course.origin)

    def within_stops(self, position: int) -> int:
        """The count nearest to a position that the axis can be at."""
        return max(self.low, min(self.high, position))

    def current(self, time: float) -> int:
        """Motor current in counts: as the motion draws, up to the peak of a contact, and 0 at rest."""
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
        self._follow(rest(time, float(round(self.position(time)))))
        self._goal = None

    def clear(self, time: float) -> None:
        self.hold(time, locks=False)
        self.status = ObjectStatus.IN_MOTION

    def arrive(self) -> None:
        """Report the end of the present motion; to be called at :attr:`ends_at`."""
        self._moved_at, self.ends_at = self.ends_at, math.inf
        self.status = self._path.outcome
        self._contacts += self.status.is_contact

    def confine(self, time: float, high: int | None) -> None:
        """Let the closing motion end at a software limit, or with None at the mechanical stop."""
        before, self.high = self.high, self._closed if high is None else high
        if self.high != before and self._goal is not None and not self._is_latched_against(self._goal):
            self._plan(time)

    def obstruct(self, time: float, obstacle: Obstacle | None, *, opening: bool) -> None:
        """Put an obstacle into one direction, or take it out of there."""
        if opening:
            self.in_opening = obstacle
        else:
            self.in_closing = obstacle
        self._look_again(time)

    def remove_obstacles(self, time: float) -> None:
        """Take out the obstacles of both directions."""
        self.in_closing = self.in_opening = None
        self._look_again(time)

    def _look_again(self, time: float) -> None:
        """Plan the motion again after obstacles have changed. An axis at rest does not: a contact latches."""
        if self.is_moving:
            self._plan(time)

    def _plan(self, time: float) -> None:
        assert self._goal is not None, "only a motion with a goal is planned"
        goal, here, before = self._goal, self.position(time), self._path
        self._path = self._path_to(here, goal)
        if self._has_reached(here, goal):
            self._follow(rest(time, here))
            self.status = ObjectStatus.AT_POSITION
            return
        self.status = ObjectStatus.IN_MOTION
        share = goal.rate_of(self._motion) / self._motion.fastest
        self._running = self._motor.running(share, closing=self._path.end > here)
        self._peak = peak(goal.force)
        # A new request does not restart the pressing.
        if not (self.is_moving and time >= self._course.presses_at and self._path == before):
            self._follow(self._course_to(time, here, goal))
        self._closes = self._path.end > here

    def _course_to(self, time: float, here: float, goal: Goal) -> AxisCourse:
        motion, (end, outcome, _) = self._motion, self._path
        rate, closing = goal.rate_of(motion), end > here
        if motion.is_straight or goal.rate:
            pressing = motion.pressing_time(rate) if outcome.is_contact else 0.0
            return straight(time, here, end, rate, pressing)
        # An axis on its way takes a new request at once; one that is about to move does not begin again.
        begin = self._course.moves_at if self.is_moving else time + self._start_s(time, closing=closing)
        begin = max(time, begin)
        is_stop = not outcome.is_contact and (end <= self.low or end >= self._closed_stop(goal))
        presses = outcome.is_contact or (is_stop and closing)
        early = self._spread.early(self._contacts) if outcome.is_contact else 0.0
        return of_a_jaw(begin, here, end, rate, motion, lands=is_stop, presses=presses, early=early)

    def _start_s(self, time: float, *, closing: bool) -> float:
        """Seconds until an axis at rest begins to move: none if it continues in the same direction."""
        goes_on = closing is self._closes and time - self._moved_at < GOES_ON_S
        return 0.0 if goes_on else self._motion.start_s(closing=closing)

    def _closed_stop(self, goal: Goal) -> int:
        """The count at which the closing motion ends: the stop of a jaw gives with the force."""
        return self.high - self._most_give + self._motion.give_at(goal.force, goal.rate_of(self._motion))

    def _target(self, here: float, goal: Goal) -> int:
        """The target within the stops. A jaw that has pressed its stop further does not go back from it."""
        return max(self.low, min(goal.position, max(self._closed_stop(goal), min(self.high, int(here)))))

    def _path_to(self, here: float, goal: Goal) -> _Path:
        # Multiplied by the sign, both directions compare like a closing motion.
        target = self._target(here, goal)
        sign = 1 if target > here else -1
        end = self.within_stops(target + sign * self._overshoot(goal))
        obstacle = self.in_closing if sign > 0 else self.in_opening
        if obstacle is None or (goal.clears and not obstacle.fixed):
            return _Path(end, ObjectStatus.AT_POSITION)
        surface = obstacle.position + self._spread.contact(obstacle.position)
        overrun, most_overrun = self._overruns(goal)
        far_side = max(sign * obstacle.position, sign * surface) + obstacle.soft + self._spread.tolerance
        far_side += most_overrun
        if sign * here > far_side:  # the axis has passed the obstacle
            return _Path(end, ObjectStatus.AT_POSITION)
        dent = round(obstacle.soft * goal.force / 255) + overrun
        stopped = sign * max(sign * here, sign * surface + dent)
        if sign * stopped < sign * target:
            contact = ObjectStatus.CONTACT_CLOSING if sign > 0 else ObjectStatus.CONTACT_OPENING
            return _Path(stopped, contact, surface)
        return _Path(sign * min(sign * end, sign * stopped), ObjectStatus.AT_POSITION)

    def _overshoot(self, goal: Goal) -> int:
        """Counts by which the axis will overshoot: 0 at a stop, or if the goal is a reading."""
        if goal.is_reading or not self.low < goal.position < self._closed_stop(goal):
            return 0
        return self._spread.overshoot(goal.position)

    def _overruns(self, goal: Goal) -> tuple[int, int]:
        """Counts by which the next contact reads further for its speed, and the most that any does."""
        motion = self._motion
        if not motion.overrun or goal.rate:
            return 0, 0
        rate = goal.rate_of(motion)
        usual = round(motion.overrun_at(rate))
        this = self._spread.overrun(self._contacts, rate / motion.fastest)
        return max(0, usual + this), round(motion.overrun) + self._spread.most_overrun

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
        beyond = self.within_stops(goal.position) - self._course.end
        return (self.status is ObjectStatus.CONTACT_CLOSING and beyond > 0) or (
            self.status is ObjectStatus.CONTACT_OPENING and beyond < 0
        )

    def _pressed(self, time: float) -> float:
        """The share of its way into the obstacle that the axis has been pressed, 0..1."""
        end, outcome, surface = self._path
        if not outcome.is_contact:
            return 0.0
        if time >= self._course.presses_at:
            return 1.0
        return 0.0 if end == surface else max(0.0, (self.position(time) - surface) / (end - surface))

    def _follow(self, course: AxisCourse) -> None:
        if self.is_moving and course.moves_at > self._course.moves_at:
            self._moved_at = course.moves_at
        self._travelled += abs(course.origin - self._course.origin)
        self._course = course
        self.ends_at = course.ends_at
