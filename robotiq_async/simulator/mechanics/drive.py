"""One motor: follows a reference with the speed and the force of the registers, and judges contacts.

A motor is a position servo whose reference moves at the speed of the request, never farther ahead of the axis
than its force reaches. So a blocked axis pushes with its force and no more, and does not jump when the part
goes. Its gears lock themselves: a push back meets more than the force of the request.

It reports a contact when it has rested before its target for as long as its motion profile says. A jaw that
moves on after that, because the part slips or is taken away, is in motion again: its object status reports a
lost part, says the manual of the 2F. A finger of the 3-Finger locks where it met the part, and its status
stays.
"""

from __future__ import annotations

from itertools import pairwise
from typing import TYPE_CHECKING, Final

from robotiq_async.values.enums import Finger, ObjectStatus

from ..physics.driven_axis import Way

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotiq_async.values.model import Model

    from .alone import Levers

_ENDS: Final = {"finger": (0, 240), "scissor": (240, 15)}
"""Counts at the ends of a drive's range, of a 3-Finger: tools/description/kinematics.py has them from the
sources named there. A jaw has its readings."""
_RESTING: Final = 0.4
"""Counts within which an axis rests: the slowest moves by more than one while a contact is awaited."""
_TREMBLING: Final = 0.1
"""Counts that are no travel: bodies in contact never rest entirely."""
_AT_REST_S: Final = 0.3
_NEAR: Final = 0.6
"""Counts from the target at which an axis has arrived."""
_SLIPPED: Final = 2.0
"""Counts that a jaw moves after a contact before the part counts as lost."""
_LOCK: Final = 4.0
"""Times its full force that a locked motor withstands (ESTIMATE): gears that lock themselves."""
_BACK_OFF: Final = 4.0
"""Counts that an axis goes back to let go of a part (ESTIMATE)."""
_BLOCKED_S: Final = 0.02
"""Seconds of rest before its target after which an axis is blocked."""
_BEYOND: Final = 255.0
"""Counts beyond its target that the reference of a blocked axis may go, for the force of the request."""
_FREED: Final = 4.0
"""Counts that a blocked axis moves when the body in its way has gone: more than a part yields."""
_LEAD: Final = 1.3
"""Share of the way at which the servo gives its full force that the reference may be ahead."""


class MotorDrive:
    """The motor of one axis. Positions are counts.

    Attributes:
        index: of its actuator in the world.
        position: of the axis.
        travel: the distance that it has travelled.
        outcome: of the last goal.
        clears: whether parts are out of the way, until it has opened or has another order.
    """

    def __init__(
        self, model: Model, axis: Finger, index: int, levers: Levers, gains: tuple[float, float]
    ) -> None:
        self.index = index
        (self._low, self._high), places = levers
        self._levers = _slopes(places)
        gain, damping = gains
        self._forces = model.forces_n
        self._locks = model.has_modes
        first, last = _counts_at_ends(model, axis, levers[0])
        self._ends = min(first, last), max(first, last)
        self._scale = (self._high - self._low) / (last - first)
        self._zero = self._low - first * self._scale
        self._stiffness = gain * abs(self._scale)
        """Force of the servo for each count."""
        self._gain, self._damping = gain, damping
        self.position: float = float(model.stroke.open_reading)
        if axis is Finger.SCISSOR:
            self.position = (first + last) / 2
        self.travel: float = 0.0
        self.outcome: ObjectStatus = ObjectStatus.IN_MOTION
        self.clears: bool = False
        self._target = self._aim = self._reference = self._farthest = self.position
        self._sign = 1.0
        self._way = Way(0.0)
        self._waits_s = 0.0
        """Seconds until it begins to move."""
        self._newtons = 0.0
        self._has_goal = False
        self._is_locked = True
        self._is_blocked = False
        self._rested = 0.0
        self._rests_at = self._counted_at = self._blocked_at = self.position
        self._ended_at = 0.0

    @property
    def share(self) -> float:
        """Its place between the ends of its actuator, 0..1."""
        return (self._value(self.position) - self._low) / (self._high - self._low)

    @property
    def is_pressing(self) -> bool:
        return self._rested > 0 and not self._is_near

    @property
    def is_still(self) -> bool:
        """Whether it has rested for a while, and has no goal."""
        return not self._is_going and self._rested > _AT_REST_S

    @property
    def _is_going(self) -> bool:
        return self._has_goal and self.outcome is ObjectStatus.IN_MOTION

    @property
    def _presses(self) -> bool:
        """Whether it keeps a grip: another request in its direction does not let go of the part first."""
        return self._sign * (self._reference - self.position) > _NEAR

    @property
    def _is_near(self) -> bool:
        return abs(self._target - self.position) <= _NEAR

    def go(self, target: float, way: Way, force: int, *, clears: bool) -> None:
        low, high = self._ends
        self._target = min(max(target, low), high)
        self._aim = min(max(target, low - 1), high + 1)  # pressed against a stop, it reads the stop
        least, most = self._forces
        if not self._is_going:
            self._waits_s = way.start_s
        self._way, self._newtons = way, least + (most - least) * force / 255
        before, self._sign = self._sign, 1.0 if self._target > self.position else -1.0
        turns = before != self._sign
        if turns or not (self._is_going or self._presses):
            self._reference = self._farthest = self.position
        # A new request in the same direction does not restart the pressing: a loop of 50 Hz sends many.
        if turns or not self._is_going:
            self._rested, self._is_blocked = 0.0, False
        self.clears = clears
        self.outcome = ObjectStatus.IN_MOTION
        self._has_goal, self._is_locked = True, False

    def hold(self) -> None:
        self._lock(presses=self._has_goal and self.outcome.is_contact)
        self._has_goal = self.clears = False

    def release(self) -> None:
        self.hold()
        self._reference = self.position - self._sign * _BACK_OFF

    def command(self, step_s: float) -> tuple[float, float]:
        """The servo's reference and the limit of its force for a step, in the units of the actuator."""
        if self._is_locked:
            return self._value(self._reference), _LOCK * (self._forces[1] * self._lever())
        position, sign, most = self.position, self._sign, self._rate() * step_s
        limit, back = self._limit(), self._pushed_back()
        # Also near the target: a body in the way is pressed with the force of the request.
        way = self._aim + sign * _BEYOND * self._is_blocked - self._reference
        moved = min(max(way, -most), most)
        lead = _LEAD * limit / self._stiffness + back + 2 * most
        self._reference = min(max(self._reference + moved, position - lead), position + lead)
        # Makes up for the speed that damping costs.
        ahead = self._damping * self._scale * moved / step_s / self._gain
        return self._value(self._reference) + ahead, limit + self._stiffness * back

    def _rate(self) -> float:
        """Counts a second of the reference now."""
        way = self._way
        if self._waits_s > 0:
            return 0.0
        lands = way.landing and abs(self._aim - self._reference) <= way.landing
        return way.landing_rate if lands else way.rate

    @property
    def _has_its_force(self) -> bool:
        """Whether it presses with all of the force of the request.

        The servo of a slow motor gets its force bit by bit. A finger that locks before is left with less:
        with 22 N of 60 if it bends around an edge from there on.
        """
        return not self._locks or abs(self._reference - self.position) * self._stiffness >= self._limit()

    def _pushed_back(self) -> float:
        """Counts that a finger was pushed back.

        That turns no gear: the servo bears it in addition to the force of the request. The pads of a jaw have
        one motor, and do not push each other back.
        """
        if not self._locks:
            return 0.0
        if self._sign * (self.position - self._farthest) > 0:
            self._farthest = self.position
        return abs(self._farthest - self.position)

    def _value(self, counts: float) -> float:
        return self._zero + self._scale * counts

    def _lever(self) -> float:
        """The motor's force for a newton at the pads: straight between places that are evenly apart."""
        share = (self._value(self.position) - self._low) / (self._high - self._low)
        at = min(max(share, 0.0), 1.0) * (len(self._levers) - 1)
        place = int(at)
        lever, slope = self._levers[place]
        return lever + slope * (at - place)

    def _limit(self) -> float:
        """The force of the request, in the units of the actuator."""
        return self._newtons * self._lever()

    def _lock(self, *, presses: bool) -> None:
        """Stay here, with the force of the request if it presses against something."""
        if not self._is_locked:
            ahead = self._limit() / self._stiffness + self._pushed_back() if presses else 0.0
            self._reference = self.position + self._sign * ahead
        self._is_locked = True

    def see(self, value: float, step_s: float) -> None:
        """Take the position of the axis after a step, and judge it."""
        self.position = position = (value - self._zero) / self._scale
        way = abs(position - self._counted_at)
        if way >= _TREMBLING:
            self.travel += way
            self._counted_at = position
        if self._is_blocked or self._rested >= _BLOCKED_S:
            self._see_blocked()
        self._waits_s -= step_s
        if self._waits_s <= 0 and abs(position - self._rests_at) <= _RESTING:
            self._rested += step_s
        else:
            self._rested, self._rests_at = 0.0, position
        if not self._has_goal:
            return
        if self.outcome is ObjectStatus.IN_MOTION:
            if self._rested >= min(self._way.arrival_s, self._way.pressing_s):
                self._judge()
            # Parts come back to open fingers; between closed ones there is no room for them.
            self.clears = self.clears and (self._is_going or self._sign > 0)
        elif not self._locks and self._has_moved_on:
            self.outcome = ObjectStatus.IN_MOTION
            self._rested = 0.0

    def _see_blocked(self) -> None:
        if self._is_blocked:
            on, beyond = self.position - self._blocked_at, self.position - self._target
            if self._sign * on > _FREED or self._sign * beyond > _NEAR:  # the body in the way has gone
                self._is_blocked = False
                self._reference = self._sign * min(self._sign * self._reference, self._sign * self._aim)
        elif not (self._is_near or self._is_locked):
            self._is_blocked, self._blocked_at = True, self.position

    @property
    def _has_moved_on(self) -> bool:
        """Whether a jaw leaves its place: a part slips or has gone, or one was put back between its pads."""
        return abs(self.position - self._ended_at) > _SLIPPED or (self.outcome.is_contact and self._is_near)

    def _judge(self) -> None:
        is_all = self._is_blocked or self._reference == self._aim
        if self._is_near and is_all and self._rested >= self._way.arrival_s:
            self.outcome = ObjectStatus.AT_POSITION
            self._ended_at = self.position
        elif self._rested >= self._way.pressing_s and not self._is_near and self._has_its_force:
            closing = self._target > self.position
            self.outcome = ObjectStatus.CONTACT_CLOSING if closing else ObjectStatus.CONTACT_OPENING
            self._ended_at = self.position
            if self._locks:
                self._lock(presses=True)


def _counts_at_ends(model: Model, axis: Finger, values: tuple[float, float]) -> tuple[int, int]:
    if model.has_modes:
        return _ENDS["scissor" if axis is Finger.SCISSOR else "finger"]
    open_first = model.stroke.open_reading, model.stroke.closed_reading
    # A Hand-E's joint grows as it opens.
    return open_first if values[0] == 0 and values[1] > 0.1 else open_first[::-1]


def _slopes(levers: Sequence[float]) -> list[tuple[float, float]]:
    """Each lever, and its gain to the next."""
    gains = [after - before for before, after in pairwise(levers)]
    return [*zip(levers, gains, strict=False), (levers[-2] + gains[-1], 0.0)]
