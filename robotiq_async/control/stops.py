"""Stops: a halt, a reset, and the end of a hand. Each has a level; a new stop replaces the one before.

The first write of a stop leaves before the read of its cycle: a gripper may obey and not answer. It may also
acknowledge a write that comes soon after another one and forget it [manual 2014, pp. 58, 75: space them by
10 ms]; a first write that came so soon is written again before it counts. Keeping is the exception.
"""

# Duty        Begun by                          First image          Over when
#
# RESET       reset(); a halt, while something  rACT = 0             it shows
#             drives the fingers
# HALT        halt()                            rGTO = 0             it shows, or was written twice
# SHUTDOWN    the end of the hand               rGTO = 0             its whole echo shows
# Keeping     the same, to keep a grip          holds moving axes    every axis rests; in any doubt a
#                                                                    SHUTDOWN replaces it
# Procedure   activate(), atr()                 rACT or rATR = 1     it has ended or failed, see there
#
# A hand has one duty or none: then the pending changes are written. A new duty replaces the one before, and a
# lost link ends it. A halt takes a device cycle, and a status counts meanwhile as ever; in all others it
# counts for the duty alone, and the condition counts again afterwards. A duty is called twice in a cycle: in
# see() after the read, and in next_image() in the turn of the loop in which the link writes.

from __future__ import annotations

import math
from dataclasses import replace
from typing import Final, NamedTuple

from ..runtime.logger import Log
from ..values.enums import Fault, Finger, State, StopLevel, Trigger
from ..values.request import Request
from ..values.status import RobotiqStatus
from .entry import Entry
from .evidence import classify, is_activating
from .gate import at_rest
from .ledger import Ledger
from .pending import MOST_HALTS

KEEP_S: Final = 0.5
"""Time for the axes to come to rest. The rest of the 2 s of a stop is enough to clear rGTO even on the
slowest gripper considered (a device cycle of 0.2 s)."""
REST_S: Final = 0.05
"""Time for which every axis must rest: ten polls. rest.py waits, besides, for recent requests that gDT may
not show yet."""


class Ended(NamedTuple):
    """The end of a duty: it has nothing more to write. ``why`` says how it failed; empty if it did not."""

    why: str = ""


class Duty:
    """A stop or a procedure, until its end. A hand does one at a time; a new one replaces it."""

    activates = releases = False  # whether its images may raise rACT, and rATR
    is_halt = False  # in all others a status counts for the duty alone

    def __init__(self, states: tuple[State, State] | None = None) -> None:
        self.writes: Final[list[Entry]] = []
        self._states: Final = states

    @property
    def state(self) -> State | None:
        """The state of the hand during the duty; None if the gripper's condition decides it."""
        return None if self._states is None else self._states[self.is_delivered]

    @property
    def is_delivered(self) -> bool:
        """Whether its first write was acknowledged."""
        return bool(self.writes) and self.writes[0].acknowledged is not None

    def written(self, entry: Entry) -> None:
        self.writes.append(entry)


class Stop(Duty):
    """One stop, until it is reached. A new level is a new stop; so is the same one, to be written again."""

    def __init__(self, level: StopLevel) -> None:
        super().__init__((State.DO_RESET, State.WF_RESET) if level is StopLevel.RESET else None)
        self.level: Final = level
        self.is_halt = level is StopLevel.HALT
        self._was_active = False  # before its first write: only our own activation is taken back

    def is_urgent(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether its first write leaves before the next read."""
        return not self.writes and self.has_cause(ledger, status)

    def has_cause(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether there is anything to stop."""
        # The hand ends: a write that does not act yet may set rGTO, or activate.
        is_asked = self.level in (StopLevel.HALT, StopLevel.RESET)
        return is_asked or status.go_echo or not ledger.is_settled

    def next_image(self, ledger: Ledger, status: RobotiqStatus) -> Request | Ended | None:
        """The image to write now: the first if there is anything to stop, or the last if it is due again."""
        if not self.writes:
            self._was_active = status.is_activated
            return self.first_image(ledger, status) if self.has_cause(ledger, status) else Ended()
        last = self.writes[-1]
        # An early write is always repeated: the gripper may yet forget it.
        return last.image if last.is_early or (self._rules(status)[0] and ledger.acts(last)) else None

    def first_image(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        if self.level is StopLevel.RESET:  # rACT = 0 clears faults and ends sequences [manual 2012, 4.6]
            return replace(at_rest(ledger.base, status), activate=False)
        is_foreign = self.level is StopLevel.SHUTDOWN and ledger.match is None
        if is_foreign and classify(status) is Trigger.SEEN_READY:
            ledger.adopt(status)  # stop the fingers even if another client moves them
        # Positions and speeds stay as requested, and an active gripper stays active: the gate sees to rACT.
        return replace(ledger.base, activate=True, go=False)

    def _rules(self, status: RobotiqStatus) -> tuple[bool, bool]:
        """Whether its last image, once it acts, is due again; and whether the stop is over then."""
        entry, is_reset = self.writes[-1], classify(status) is Trigger.SEEN_RESET
        match self.level:
            case StopLevel.RESET:
                return status.activation_echo, is_reset
            case StopLevel.HALT:
                # Twice at most. The gripper may have forgotten early ones.
                is_spent = sum(not each.is_early for each in self.writes) >= MOST_HALTS
                return status.go_echo and not is_spent, not status.go_echo or is_spent
            case StopLevel.SHUTDOWN:
                # While another client resets the gripper it comes to rest, and rACT might cross that.
                is_safe = status.activation_echo or not entry.image.activate
                # gGTO = 0 alone may be from before the write before, and the next client would adopt an echo
                # that is about to change.
                return is_safe, is_reset or status.echo == entry.echo
        return False, False  # moving axes are held once

    def see(self, ledger: Ledger, status: RobotiqStatus) -> Stop | None:
        """Take in a status; return the stop from then on, or None once this one is over."""
        if not self.writes or self.writes[-1].is_early:
            return self
        if self.is_halt and not status.go_echo and not ledger.may_set_go:
            return None  # then it need not act
        return None if self._rules(status)[1] and ledger.acts(self.writes[-1]) else self

    def has_activated(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether its rACT activates a gripper that another client has reset just before, or is about to."""
        if not self.is_delivered or not self.writes[-1].image.activate:
            return False
        if self.level is StopLevel.HALT:
            return classify(status) is Trigger.SEEN_RESET or is_activating(status)
        return self._was_active and ledger.acts(self.writes[-1]) and is_activating(status)


class Keeping(Stop):
    """The weakest stop: leaves rGTO set if every axis is seen at rest under a known request.

    Only a cleared rGTO stops the fingers for certain, but no public source says whether a grip then stays.
    Axes that move are held first, once. docs/decisions/keeping-a-grip.md has the reasons.
    """

    def __init__(self, status: RobotiqStatus, why_no_grip: str, log: Log) -> None:
        super().__init__(StopLevel.KEEP)
        self._log: Final = log
        self._why_no_grip: Final = why_no_grip  # if it is known from the beginning
        # Rest is timed from the request of a status, because a busy loop may read the reply late.
        self._until: Final = status.timestamp + KEEP_S
        self._since = math.inf

    def see(self, ledger: Ledger, status: RobotiqStatus) -> Stop | None:
        """Return a shutdown in any doubt, this one, or None once every axis rests."""
        ledger.update_rest(status)
        why = self._why_no_grip
        if not self.writes or ledger.acts(self.writes[-1]):  # if not, a hold will overwrite the present image
            why = why or self._doubt(ledger, status)
            self._since = min(self._since, ledger.now.time) if self._rests(ledger, status) else math.inf
        if why:
            stop = Stop(StopLevel.SHUTDOWN)
            if stop.has_cause(ledger, status):
                self._log.warning("rGTO is cleared, and no grip is kept: %s", why)
            return stop
        if ledger.now.time - self._since < REST_S:
            return self
        self._log.info("stopped with rGTO set; in contact: %s", status.contacts or "nothing")
        return None

    def is_urgent(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        # If all rests, the next status decides whether rGTO stays set.
        return not self.writes and not self._rests(ledger, status)

    def _rests(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether every axis is known to rest under its last request; also true while rGTO is clear."""
        return not status.moving and not ledger.requests.unrested and ledger.is_certain and ledger.is_settled

    def first_image(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        """The image that holds every axis that moves or is about to; None if no axis does."""
        if not ledger.is_certain:
            return None
        base = ledger.base
        held = base.with_positions(ledger.held(Finger.ALL, status))
        return None if held == base else held

    def _doubt(self, ledger: Ledger, status: RobotiqStatus) -> str:
        """The reason that no grip can be kept; empty as long as a grip may be kept."""
        condition = classify(status)
        # Any fault, also a minor one: no hand would be there to see it clear.
        if condition is not Trigger.SEEN_READY or status.fault is not Fault.NONE:
            return f"the {condition.value} ({status.fault.description})"
        if ledger.match is None:
            return "another client commands the gripper"
        if status.timestamp - ledger.now.time > KEEP_S:
            return "the newest status is old: something holds up the event loop"
        # A late object status is worth a wait. A write in doubt is not.
        is_late = not status.moving and status.timestamp < self._until
        if ledger.has_recent_doubt or (not ledger.is_certain and not is_late):
            return "the request of the gripper is not known for certain"
        if ledger.is_settled and not status.go_echo:
            return "rGTO was clear"
        if status.timestamp >= self._until and not self._rests(ledger, status):
            return f"not every axis came to rest within {KEEP_S:g} s"
        return ""
