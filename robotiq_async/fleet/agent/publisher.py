"""HandPublisher: publishes statuses, events and summaries of one hand.

Statuses and events share one key, which keeps their order. Both may be dropped on a full link. The next
status replaces a lost one; events are numbered and every status has the newest number, so a client notices a
lost event and requests it.
"""

from __future__ import annotations

import json
from collections import deque
from itertools import islice
from typing import Any, Final

from ...local import RobotiqHand
from ...runtime import now
from ...values import RobotiqError, RobotiqStatus, SentRequest, Transition
from ..control.lease import Lease
from ..network.bus import Bus, Urgency
from ..wire.names import GripperName
from ..wire.status_message import StatusMessage
from ..wire.values import Fields
from .inhibits import Inhibits

KEPT: Final = 2000
"""Events that are kept for clients that missed them: some seconds of a loop that commands at 200 Hz."""
AT_ONCE: Final = 40  # events in one answer: even the longest ones fit into a message


class HandPublisher:
    """Publishes one hand.

    Attributes:
        problem: why the gripper cannot be reached; empty if it can.
    """

    def __init__(
        self, name: GripperName, hand: RobotiqHand, bus: Bus, epoch: int, lease: Lease, inhibits: Inhibits
    ) -> None:
        self.problem: str = ""
        self._name = name
        self._mark = name.mark
        self._hand = hand
        self._epoch = epoch
        self._lease = lease
        self._inhibits = inhibits
        self._send = bus.publisher(name.key("feed"), Urgency.TELEMETRY)
        self._send_summary = bus.publisher(name.key("summary"), Urgency.TELEMETRY)
        self._events: deque[Fields] = deque(maxlen=KEPT)
        self._count = 0
        self._sent_at = 0.0
        self._statistics = hand.statistics.as_dict()  # of the last summary: they are most of its work

    def note_problem(self, why: str) -> None:
        """The gripper cannot be reached, for this reason; empty if it can."""
        self.problem = why

    def observe(self, what: RobotiqStatus | Transition | SentRequest) -> None:
        if isinstance(what, RobotiqStatus):
            self.send_status()
        elif isinstance(what, Transition):
            self.add({"kind": "transition", **what.as_dict()})
        else:
            self.add({"kind": "request", **what.as_raw()})

    def add(self, event: Fields) -> None:
        self._count += 1
        event = {"index": self._count, **event}
        self._events.append(event)
        # With the status after the event: a client that waits for a state has both at once.
        status = self.status_message().hex()
        self._sent_at = now()
        self._send(json.dumps({**self._head(), "events": [event], "status": status}).encode())

    def events_since(self, index: int) -> list[Fields]:
        """The next events after a number, as many as are kept and fit into an answer."""
        return list(islice((event for event in self._events if event["index"] > index), AT_ONCE))

    def send_status(self) -> None:
        self._sent_at = now()
        self._send(self.status_message())

    def beat(self, interval: float) -> None:
        """Send a status, unless something was sent within ``interval`` seconds: a sign of life."""
        if now() - self._sent_at >= interval:
            self.send_status()

    def status_message(self) -> bytes:
        return StatusMessage(
            mark=self._mark,
            epoch=self._epoch,
            stamp=now(),
            state=self._hand.state,
            lease=self._lease.number,
            is_held=self._lease.holder is not None,
            events=self._count,
            is_moving=self._is_moving(),
            status=self._status(),
        ).pack()

    def send_summary(self) -> None:
        self._statistics = self._hand.statistics.as_dict()
        self._send_summary(json.dumps(self.summary()).encode())

    def summary(self) -> Fields:
        stamp, holder, status = now(), self._lease.holder, self._status()
        return {
            **self._head(),
            "to": self._name.base,
            **self._inhibits.told(),
            "stamp": stamp,
            "age": None if status is None else stamp - status.timestamp,
            "address": self._hand.address,
            "model": self._hand.model.name,
            "stroke": self._hand.units.stroke.points,
            "state": self._hand.state.name,
            "fault": None if status is None else int(status.fault),
            "is_moving": self._is_moving(),
            "holder": None if holder is None else holder.label,
            "problem": self.problem,
            "statistics": self._statistics if self._statistics["polls"] else self._hand.statistics.as_dict(),
        }

    def _head(self) -> dict[str, Any]:
        return {"mark": self._mark, "epoch": self._epoch}

    def _status(self) -> RobotiqStatus | None:
        try:
            return self._hand.status
        except RobotiqError:
            return None

    def _is_moving(self) -> bool:
        try:
            return self._hand.is_moving
        except RobotiqError:  # not connected: unknown
            return False
