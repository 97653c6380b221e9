"""stop(keep_grip=True): leaves rGTO set if no axis moves.

Clearing rGTO is what stops the fingers for certain, but no public source says what then becomes of a grip. A
hand may therefore leave rGTO set when it is stopped, if every axis is seen at rest under a known request.
Axes that move are held first, once, as after a cancelled move. In any doubt rGTO is cleared.
docs/decisions/keeping-a-grip.md has the reasons.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from ..runtime.log import Log, log
from ..values.enums import NO_AXES, Fault, Finger, State, Trigger
from ..values.request import Request
from ..values.status import RobotiqStatus
from .requests.merging import merged
from .requests.pending import PendingCommand
from .requests.shadow import Doubt, RequestShadow, Whose
from .sequences import Sequence, stop_fingers
from .state_machine import RUNNING
from .triggers import classify

KEEP_S: Final = 0.5
"""Time for the axes to come to rest. The rest of the 2 s of a stop is enough to clear rGTO even on the
slowest gripper considered (a device cycle of 0.2 s)."""
REST_S: Final = 0.05
"""Time for which every axis must rest: ten polls. requests/standstill.py waits, besides, for recent requests
that gDT may not show yet."""


class GripKeeper:
    """Decides whether a hand that is being stopped may leave rGTO set.

    Attributes:
        doubt: why rGTO must be cleared whatever the statuses show; empty for no reason.
    """

    def __init__(self, shadow: RequestShadow, *, log: Log = log) -> None:
        self._shadow = shadow
        self._log = log
        self.doubt = ""

    def begin(self, state: State, *, halts: bool) -> None:
        """Begin in the state in which the hand is stopped; ``halts`` if a halt has not been sent."""
        running = "" if state in RUNNING else f"the hand was in {state.name}"
        self.doubt = "halt() was asked for" if halts else running

    def rests(self, status: RobotiqStatus) -> bool:
        """Whether every axis is known to rest under its last request, and there is no fault."""
        shadow = self._shadow
        ready = classify(status) is Trigger.SEEN_READY and status.fault is Fault.NONE and not self.doubt
        rests = not status.moving and shadow.axes.resting is Finger.ALL and shadow.doubt is None
        return ready and status.go_echo and shadow.acts() and rests

    def sequence(self, image_to_stop: Callable[[RobotiqStatus], Request | None]) -> Sequence:
        """Hold what moves and leave rGTO set once everything rests.

        On any doubt it writes ``image_to_stop`` of the newest status, and sees that it acts.
        """
        status = yield None
        # Rest is timed by when a status was asked for, because a busy loop may read the reply late.
        until, since, may_hold = status.timestamp + KEEP_S, math.inf, True
        while True:
            self._shadow.axes.see(status, self._shadow.now)
            if doubt := self.doubt or self._trouble(status):
                break
            self._shadow.follow(self._shadow.identify(), status)
            if doubt := self._unrest(status, until):
                break
            image = self._held(status) if may_hold and self._shadow.doubt is None else None
            if image is not None:
                may_hold, since = False, math.inf
                status = yield image
                continue
            since = min(since, self._shadow.now.time) if self.rests(status) else math.inf
            if self._shadow.now.time - since >= REST_S:
                self._log.info("stopped with rGTO set; in contact: %s", status.contacts or "nothing")
                return
            status = yield None
        last = image_to_stop(status)
        if last is not None:
            self._log.warning("rGTO is cleared, and no grip is kept: %s", doubt)
            yield from stop_fingers(last, status)

    def _trouble(self, status: RobotiqStatus) -> str:
        """Why the condition of the gripper forbids it; empty for no reason."""
        condition = classify(status)
        if condition is not Trigger.SEEN_READY or status.fault is not Fault.NONE:
            return f"the {condition.value} ({status.fault.description})"
        if self._shadow.identify() is Whose.FOREIGN:
            return "another client commands the gripper"
        return ""

    def _unrest(self, status: RobotiqStatus, until: float) -> str:
        """Why the axes do not allow it; empty for no reason."""
        if status.timestamp - self._shadow.now.time > KEEP_S:
            return "the newest status is old: something holds up the event loop"
        # A late object status is worth a wait. A write that was lost with the link is not.
        is_late = not status.moving and status.timestamp < until
        doubt = self._shadow.doubt
        if doubt is Doubt.LOST_WRITE or (doubt is Doubt.ADOPTED_AXIS and not is_late):
            return "what the gripper was asked is not known for certain"
        if self._shadow.acts() and not status.go_echo:
            return "rGTO was clear"
        if status.timestamp >= until and not self.rests(status):
            return f"not every axis came to rest within {KEEP_S:g} s"
        return ""

    def _held(self, status: RobotiqStatus) -> Request | None:
        """The image that holds every axis that moves or is about to; None if no axis does."""
        shadow = self._shadow
        held = PendingCommand(hold=Finger.ALL)
        image = merged(
            shadow.base,
            held,
            status,
            gripping=NO_AXES,
            arrived=shadow.axes.resting,
            doubtful=shadow.axes.doubtful(status, shadow.now),
        )
        return None if image == shadow.base else image
