"""An axis that a mechanism moves: its position and contacts come from a simulation of bodies.

The registers, the firmware and their timing are as without a mechanism. It moves drives; an axis gives its
drive goals, and reports their outcomes.
"""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Final, NamedTuple, Protocol

from robotiq_async.calibration.motion_profile import PRESSING_S
from robotiq_async.values.enums import ObjectStatus
from robotiq_async.values.model import TOLERANCE

from .axis import Axis, Goal, Motor, peak
from .course import rest
from .spread import Spread

if TYPE_CHECKING:
    from collections.abc import Callable

    from robotiq_async.calibration.motion_profile import MotionProfile
    from robotiq_async.values.enums import Finger
    from robotiq_async.values.model import Model

    from .bodies import Bodies


_ARRIVED_S: Final = 0.01


class PhysicsError(RuntimeError):
    """The bodies of a simulated gripper cannot be moved any more; the error before is its cause."""


class Way(NamedTuple):
    """The motion to a goal in time.

    Attributes:
        rate: counts a second.
        start_s: seconds until an axis at rest begins to move.
        pressing_s: seconds for which it presses before a contact is reported.
        arrival_s: seconds for which it rests before its arrival is reported.
        landing: counts before an end stop that it travels at another rate.
        landing_rate: that rate.
    """

    rate: float
    start_s: float = 0.0
    pressing_s: float = PRESSING_S
    arrival_s: float = _ARRIVED_S
    landing: float = 0.0
    landing_rate: float = math.inf


class Drive(Protocol):
    """One motor of a mechanism, in counts.

    Attributes:
        position: its present place.
        travel: the distance it has travelled, in both directions.
        outcome: of the last goal: IN_MOTION until it rests.
        is_pressing: whether it presses against something that it has not reported yet.
    """

    @property
    def position(self) -> float: ...

    @property
    def travel(self) -> float: ...

    @property
    def outcome(self) -> ObjectStatus: ...

    @property
    def is_pressing(self) -> bool: ...

    def go(self, target: float, way: Way, force: int, *, clears: bool) -> None:
        """Go to a position in counts.

        Args:
            target: the position.
            way: the speed, and the other properties of a motion.
            force: of the register, 0..255.
            clears: parts are out of the way until it has opened, or has another order.
        """

    def hold(self) -> None:
        """Stop and stay, with the force it has."""

    def release(self) -> None:
        """Stop, and let go of the part."""


class Mechanism(Protocol):
    """The bodies that move the axes of a gripper.

    Attributes:
        time: the time it has reached, in simulated seconds.
    """

    @property
    def time(self) -> float: ...

    def attach(self, model: Model, clock: Callable[[], float], speedup: float) -> None:
        """Become the mechanism of a gripper of this model, with this clock; once."""

    @property
    def threaded(self) -> bool:
        """Whether a thread moves it in real time."""

    def start(self) -> None:
        """Let its thread move it."""

    def stop(self) -> None:
        """End its thread, and wait until it has ended."""

    def drive(self, axis: Finger) -> Drive: ...

    def step(self, until: float) -> bool:
        """Make one step if it ends by a time, in simulated seconds; return whether a step was made.

        Raises:
            PhysicsError: it cannot move any more.
        """

    def bodies(self) -> Bodies:
        """Places of joints and parts."""


class HasMechanism(Protocol):
    """A :class:`Physics`, as its gripper knows it."""

    @property
    def _mechanism(self) -> Mechanism: ...


def mechanism_of(physics: HasMechanism) -> Mechanism:
    """The mechanism of a physics, for its gripper and the servers of that; programs call the physics."""
    return physics._mechanism  # noqa: SLF001  # not shown to programs


class DrivenAxis(Axis):
    """An axis without a plan: it waits for the reports of its drive.

    It is exact: the mechanism decides where it stops and touches.
    """

    def __init__(
        self, drive: Drive, axis: Finger, low: int, high: int, motor: Motor, motion: MotionProfile
    ) -> None:
        super().__init__(round(drive.position), low, high, motor, Spread(None, axis), motion)
        self._drive = drive
        self._stays = False
        """Whether the last command to the drive was to stay."""

    @property
    def is_moving(self) -> bool:
        return self._goal is not None and self.status is ObjectStatus.IN_MOTION

    def position(self, time: float) -> float:  # noqa: ARG002
        return min(max(self._drive.position, 0.0), 255.0)

    def travel(self, time: float) -> float:  # noqa: ARG002
        return self._drive.travel

    def current(self, time: float) -> int:  # noqa: ARG002
        if not self.is_moving or self._goal is None:
            return 0
        return round(peak(self._goal.force) if self._drive.is_pressing else self._running)

    def hold(self, time: float, *, locks: bool) -> None:
        held = self.holds
        self._is_locked = locks and held
        if self._goal is not None or not self._stays or (held and not locks):
            self._stays = True
            if held and not locks:
                self._drive.release()
            else:
                self._drive.hold()
        self._follow(rest(time, float(round(self.position(time)))))
        self._goal = None

    def arrive(self) -> None:
        self._follow(rest(self.ends_at, self._drive.position))
        self.status = self._drive.outcome

    def observe(self, time: float) -> bool:
        """Take the outcome of the goal: the end of a motion is due at once, and so is a slipping part.

        Returns whether something is due by then.
        """
        if self._goal is not None and self._drive.outcome is not self.status:
            self.ends_at = time
        return self.ends_at <= time

    def _plan(self, time: float) -> None:
        assert self._goal is not None, "only a motion with a goal is planned"
        goal, is_under_way = self._goal, self.status is ObjectStatus.IN_MOTION and not self._stays
        target = self.within_stops(goal.position)
        closing = target > (here := self.position(time))
        if is_under_way and closing is self._closes:
            self._moved_at = time  # its drive may have arrived just now
        way = self._way(time, goal, target, closing=closing)
        if abs(target - here) > TOLERANCE:  # bodies overshoot a little, and tremble at rest
            self._closes = closing
        self.ends_at = math.inf
        self.status = ObjectStatus.IN_MOTION
        self._stays = False
        self._running = self._motor.running(way.rate / self._motion.fastest, closing=closing)
        self._drive.go(target, way, goal.force, clears=goal.clears)

    def _way(self, time: float, goal: Goal, target: int, *, closing: bool) -> Way:
        motion, rate = self._motion, goal.rate_of(self._motion)
        pressing = motion.pressing_time(rate)
        if goal.rate or motion.is_straight:
            return Way(rate, pressing_s=pressing)
        at_stop = target in (self.low, self.high)
        return Way(
            rate,
            self._start_s(time, closing=closing),
            max(pressing, PRESSING_S),  # bodies take that long to come to rest
            pressing if at_stop and closing else _ARRIVED_S,
            motion.landing if at_stop else 0.0,
            min(motion.slowest, rate),
        )
