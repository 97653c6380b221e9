"""stop(keep_grip=True): leaves rGTO set if no axis moves.

Clearing rGTO is what stops the fingers for certain, but no public source says what then becomes of a grip. A
hand may therefore leave rGTO set when it is stopped, if every axis is seen at rest under a known request.
Axes that move are held first, once, as after a cancelled move. In any doubt rGTO is cleared.
docs/decisions/keeping-a-grip.md has the reasons.
"""

from __future__ import annotations

import math
from typing import Final

from ..values.enums import Fault, Finger, StopLevel, Trigger
from ..values.request import Request
from ..values.status import RobotiqStatus
from .evidence import classify
from .ledger import Ledger
from .pending import Pending, merged
from .stops import Stop

KEEP_S: Final = 0.5
"""Time for the axes to come to rest. The rest of the 2 s of a stop is enough to clear rGTO even on the
slowest gripper considered (a device cycle of 0.2 s)."""
REST_S: Final = 0.05
"""Time for which every axis must rest: ten polls. rest.py waits, besides, for recent requests that gDT may
not show yet."""


class Keeping(Stop):
    """The weakest stop.

    Args:
        status: the newest one.
        doubt: why rGTO must be cleared whatever the statuses show; empty for no reason.

    Attributes:
        doubt: why rGTO must be cleared, as far as the statuses so far show; empty for no reason.
    """

    def __init__(self, status: RobotiqStatus, doubt: str) -> None:
        super().__init__(StopLevel.KEEP)
        self.doubt = doubt
        # Rest is timed by when a status was asked for, because a busy loop may read the reply late.
        self._until = status.timestamp + KEEP_S
        self._since = math.inf

    def judge(self, ledger: Ledger, status: RobotiqStatus) -> None:
        """Take in a status. While a hold is on its way nothing is doubted: it overwrites what came before."""
        if self.entry is not None and not ledger.acts(self.entry):
            return
        self.doubt = self.doubt or self._trouble(ledger, status) or self._unrest(ledger, status)
        self._since = min(self._since, ledger.now.time) if self.rests(ledger, status) else math.inf

    def is_urgent(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        # If all rests, the next status decides whether rGTO stays set.
        return self.entry is None and not self.rests(ledger, status)

    def rests(self, ledger: Ledger, status: RobotiqStatus) -> bool:
        """Whether every axis is known to rest under its last request, with rGTO set."""
        rests = not status.moving and not ledger.unrested and ledger.is_certain
        return rests and status.go_echo and ledger.acts() and not self.doubt

    def is_reached(self, ledger: Ledger, status: RobotiqStatus) -> bool:  # noqa: ARG002
        return ledger.now.time - self._since >= REST_S

    def again(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:  # noqa: ARG002
        return None  # what moves is held once

    def image(self, ledger: Ledger, status: RobotiqStatus) -> Request | None:
        """The image that holds every axis that moves or is about to; None if no axis does."""
        if not ledger.is_certain:
            return None
        base = ledger.base
        held = merged(
            base,
            Pending(hold=Finger.ALL),
            status,
            arrived=ledger.resting,
            doubtful=ledger.doubtful(status),
        )
        return None if held == base else held

    def _trouble(self, ledger: Ledger, status: RobotiqStatus) -> str:
        """Why the condition of the gripper forbids it; empty for no reason."""
        # Any fault, also a minor one: its clearing is an event that nobody would be there to see.
        condition = classify(status)
        if condition is not Trigger.SEEN_READY or status.fault is not Fault.NONE:
            return f"the {condition.value} ({status.fault.description})"
        return "another client commands the gripper" if ledger.match is None else ""

    def _unrest(self, ledger: Ledger, status: RobotiqStatus) -> str:
        """Why the axes do not allow it; empty for no reason."""
        if status.timestamp - ledger.now.time > KEEP_S:
            return "the newest status is old: something holds up the event loop"
        # A late object status is worth a wait. A write that was lost with the link is not.
        is_late = not status.moving and status.timestamp < self._until
        if ledger.has_lost_write or (not ledger.is_certain and not is_late):
            return "what the gripper was asked is not known for certain"
        if ledger.acts() and not status.go_echo:
            return "rGTO was clear"
        if status.timestamp >= self._until and not self.rests(ledger, status):
            return f"not every axis came to rest within {KEEP_S:g} s"
        return ""
