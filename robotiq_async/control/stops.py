"""Stops: a halt, a reset, and what ends a hand. Each is a level; a new one replaces the one before.

The first write of a stop leaves before the read of its cycle: a gripper may obey and not answer. A stop may
be written again, as it only ends motion: a gripper may acknowledge a write that comes soon after another one
and forget it [manual 2014, pp. 58, 75: space them by 10 ms]. KEEP is the exception to both.
"""

# Level     First write           Written again                   Over when
#
# RESET     at once               once it acts, while gACT shows  it acts, and the gripper shows reset
# HALT      at once               once, if it acts and gGTO       gGTO = 0, and it acts or nothing that waits
#                                 shows                           sets rGTO; or the second write acts (if gGTO
#                                                                 shows even then, halt() fails)
# SHUTDOWN  at once               once it acts, unless its rACT   it acts, and its echo or a reset shows; at
#                                 might rise                      once if there is nothing to stop
# KEEP      after write_spacing,  never                           every axis rests for REST_S; in any doubt a
#           only what moves                                       SHUTDOWN replaces it
#
# A write acts once it has shown, or WINDOW_S after its acknowledgement. A first write that came within
# write_spacing of another is written again before it counts.

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import replace
from typing import Final, NamedTuple

from ..runtime.logger import Log
from ..values.enums import Fault, Finger, StopLevel, Trigger
from ..values.errors import StateTimeoutError
from ..values.request import Request
from ..values.status import RobotiqStatus
from .entry import Entry
from .evidence import FOLLOWS, classify, is_activating
from .gate import at_rest
from .ledger import WINDOW_S, Ledger
from .waiters import Waiter, fail, resolve

KEEP_S: Final = 0.5
"""Time for the axes to come to rest. The rest of the 2 s of a stop is enough to clear rGTO even on the
slowest gripper considered (a device cycle of 0.2 s)."""
REST_S: Final = 0.05
"""Time for which every axis must rest: ten polls. rest.py waits, besides, for recent requests that gDT may
not show yet."""
MOST_HALTS: Final = 2
"""The most times that a halt is sent. If rGTO still shows then, its callers get an error."""


class Write(NamedTuple):
    """One write of a stop."""

    entry: Entry
    is_early: bool  # it came within write_spacing of another: the gripper may have forgotten it
    was_active: bool  # whether the gripper was, before it: what activates already is not ours to take back


class Stop:
    """One stop, from its request until it is reached. A new level is a new stop."""

    def __init__(self, level: StopLevel, before: Stop | None = None) -> None:
        self.level: Final = level
        # Those of halt(), each with the stop that was begun for it: this one, or one that it has replaced.
        self.callers: Final[dict[Waiter[None], Stop]] = {**before.callers} if before else {}
        self.writes: Final[list[Write]] = []

    @property
    def is_delivered(self) -> bool:
        """Whether a write of it was acknowledged: it is sent again only after that."""
        return bool(self.writes) and self.writes[0].entry.acknowledged is not None

    @property
    def _times(self) -> int:
        """The number of its writes that the gripper cannot have forgotten."""
        return sum(not each.is_early for each in self.writes)

    def written(self, entry: Entry, status: RobotiqStatus, *, is_early: bool) -> None:
        self.writes.append(Write(entry, is_early, status.is_activated))

    def is_urgent(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether its first write leaves before the next read."""
        return not self.writes and self.has_cause(ledger, status)

    def has_cause(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether there is anything to stop."""
        match self.level:
            case StopLevel.RESET:
                return True
            case StopLevel.HALT:
                return classify(status) in FOLLOWS
        return status.go_echo or not ledger.is_settled  # what does not act yet may set rGTO, or activate

    def image(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        """The image to write first; None if there is nothing to stop."""
        if not self.has_cause(ledger, status):
            return None
        base = ledger.base
        if self.level is StopLevel.RESET:  # rACT = 0 clears faults and ends what runs [manual 2012, 4.6]
            return replace(at_rest(base, status), activate=False)
        # Positions and speeds stay as they were asked, and what is active stays so: the gate sees to rACT.
        return replace(base, activate=True, go=False)

    def again(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        """The image of its last write, if that is due again."""
        entry, is_early, _ = self.writes[-1]
        if entry.acknowledged is None:
            return None
        if is_early:
            return entry.image  # whatever shows: the gripper may yet forget it [manual 2014, p. 75]
        is_due = {
            StopLevel.RESET: status.activation_echo,
            StopLevel.HALT: status.go_echo and self._times < MOST_HALTS,
            # While another client resets the gripper it comes to rest, and rACT might cross that.
            StopLevel.SHUTDOWN: not entry.image.activate or status.activation_echo,
            StopLevel.KEEP: False,  # what moves is held once
        }
        return entry.image if is_due[self.level] and ledger.acts(entry) else None

    def is_reached(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        if not self.writes or self.writes[-1].is_early or self.writes[-1].entry.acknowledged is None:
            return False
        if self.level is StopLevel.HALT and not status.go_echo and not ledger.may_set_go:
            return True  # then it need not act
        is_reset = classify(status) is Trigger.SEEN_RESET
        entry = self.writes[-1].entry
        shows = {
            StopLevel.RESET: is_reset,
            StopLevel.HALT: not status.go_echo or self._times >= MOST_HALTS,
            # gGTO = 0 alone may be from before the write before, and the next client would adopt an echo that
            # is about to change.
            StopLevel.SHUTDOWN: is_reset or status.echo == entry.echo,
        }
        return shows[self.level] and ledger.acts(entry)

    def add(self, caller: Waiter[None]) -> None:
        self.callers[caller] = self

    def fail_overdue(self, ledger: Ledger, status: RobotiqStatus, log: Log) -> None:
        """Fail callers whose halt does not show, however often it has been replaced since."""
        since = ledger.now.time - MOST_HALTS * WINDOW_S
        overdue = [
            caller
            for caller, stop in self.callers.items()
            if stop is not self and stop.writes[0].entry.time <= since and not caller.done()
        ]
        if overdue and status.go_echo:
            self._give_up(overdue, log)

    def answer(self, status: RobotiqStatus, log: Log) -> None:
        """Answer the callers: it is reached, or was sent as often as it may be."""
        if self.level is StopLevel.HALT and status.go_echo:
            self._give_up(self.callers, log)
        resolve(self.callers)

    def _give_up(self, callers: Iterable[Waiter[None]], log: Log) -> None:
        error = StateTimeoutError(
            f"the gripper does not show that it has stopped after {MOST_HALTS} halts: the fingers may "
            "still move (another client commands it, or it forgets writes)"
        )
        log.warning("%s", error)
        fail(callers, error)

    def has_activated(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether its rACT activates a gripper that another client has reset just before, or is about to."""
        # Two clients within one device cycle can do that [follows from Modbus].
        if not self.is_delivered or not self.writes[-1].entry.image.activate:
            return False
        entry, _, was_active = self.writes[-1]
        if self.level is StopLevel.HALT:
            return classify(status) is Trigger.SEEN_RESET or is_activating(status)
        return was_active and ledger.acts(entry) and is_activating(status)


class Keeping(Stop):
    """The weakest stop: leaves rGTO set if every axis rests.

    Clearing rGTO is what stops the fingers for certain, but what then becomes of a grip is in no public
    source. So rGTO stays set if every axis is seen at rest under a known request. Axes that move are held
    first, once, as after a cancelled move. In any doubt rGTO is cleared. docs/decisions/keeping-a-grip.md has
    the reasons.
    """

    def __init__(self, status: RobotiqStatus, why_no_grip: str) -> None:
        super().__init__(StopLevel.KEEP)
        self._why_no_grip: Final = why_no_grip  # if it is known from the beginning
        # Rest is timed by when a status was asked for, because a busy loop may read the reply late.
        self._until: Final = status.timestamp + KEEP_S
        self._since = math.inf

    def after(self, ledger: Ledger, status: RobotiqStatus, log: Log) -> Stop | None:
        """The stop after a status: a shutdown in any doubt, this one, or None once every axis rests."""
        ledger.update_rest(status)
        why = self._why_no_grip
        if not self.writes or ledger.acts(self.writes[-1].entry):  # if not, a hold will overwrite what shows
            why = why or self._trouble(ledger, status) or self._why_not_at_rest(ledger, status)
            self._since = min(self._since, ledger.now.time) if self.rests(ledger, status) else math.inf
        if why:
            stop = Stop(StopLevel.SHUTDOWN)
            if ledger.match is None and classify(status) is Trigger.SEEN_READY:
                ledger.adopt(status)
            if stop.has_cause(ledger, status):
                log.warning("rGTO is cleared, and no grip is kept: %s", why)
            return stop
        if ledger.now.time - self._since < REST_S:
            return self
        log.info("stopped with rGTO set; in contact: %s", status.contacts or "nothing")
        return None

    def is_urgent(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        # If all rests, the next status decides whether rGTO stays set.
        return not self.writes and not self.rests(ledger, status)

    def rests(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether every axis is known to rest under its last request; also true while rGTO is clear."""
        return not status.moving and not ledger.unrested and ledger.is_certain and ledger.is_settled

    def image(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        """The image that holds every axis that moves or is about to; None if no axis does."""
        if not ledger.is_certain:
            return None
        base = ledger.base
        held = base.with_positions(ledger.held(Finger.ALL, status))
        return None if held == base else held

    def _trouble(self, ledger: Ledger, status: RobotiqStatus) -> str:
        # Any fault, also a minor one: no hand would be there to see it clear.
        condition = classify(status)
        if condition is not Trigger.SEEN_READY or status.fault is not Fault.NONE:
            return f"the {condition.value} ({status.fault.description})"
        return "another client commands the gripper" if ledger.match is None else ""

    def _why_not_at_rest(self, ledger: Ledger, status: RobotiqStatus) -> str:
        if status.timestamp - ledger.now.time > KEEP_S:
            return "the newest status is old: something holds up the event loop"
        # A late object status is worth a wait. A write in doubt is not.
        is_late = not status.moving and status.timestamp < self._until
        if ledger.has_recent_doubt or (not ledger.is_certain and not is_late):
            return "what the gripper was asked is not known for certain"
        if ledger.is_settled and not status.go_echo:
            return "rGTO was clear"
        if status.timestamp >= self._until and not self.rests(ledger, status):
            return f"not every axis came to rest within {KEEP_S:g} s"
        return ""
