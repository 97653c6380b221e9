"""What happens to a hand, in the order in which it happened and with the time of day."""

from __future__ import annotations

import time
from collections.abc import Iterator

from ...hand import Hand
from ...runtime.clock import now
from ...values.events import Transition
from ...values.status import RobotiqStatus
from .payloads import Fields, fault_event, transition_fields


class Timeline:
    """Collects what happens to a hand between two looks. It only listens."""

    def __init__(self, hand: Hand, buffer: int) -> None:
        self._hand, self._buffer = hand, buffer
        self._before: RobotiqStatus | None = None
        self.open()

    def open(self) -> None:
        """Listen from now on: the streams end when the hand is stopped."""
        self._statuses = self._hand.statuses(self._buffer)
        self._transitions = self._hand.transitions()

    @property
    def missed(self) -> int:
        """Statuses that were dropped because the buffer was full."""
        return self._statuses.missed

    def new(self) -> Iterator[tuple[float, RobotiqStatus | Fields]]:
        """Statuses, and events for transitions and faults, each with its time in seconds since 1970."""
        # Timestamps of a hand are monotonic; people and files use the wall clock.
        offset = time.time() - now()
        happened: list[RobotiqStatus | Transition] = [*self._transitions.drain(), *self._statuses.drain()]
        for each in sorted(happened, key=lambda one: one.timestamp):
            at = offset + each.timestamp
            if isinstance(each, Transition):
                yield at, transition_fields(each)
                continue
            yield at, each
            if event := fault_event(each, self._before):
                yield at, event
            self._before = each
