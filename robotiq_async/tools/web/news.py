"""What a page is told about a hand: what is newest, and the events since it was told last."""

from __future__ import annotations

import time
from collections import deque
from collections.abc import Iterator
from typing import Final

from ...hand import Hand
from ...runtime.clock import now
from ...session.streams import Stream
from ...values.enums import Fault, State
from ...values.errors import NotStartedError
from ...values.events import Transition
from ...values.status import RobotiqStatus
from ..recording.payloads import Fields, fault_fields, transition_fields

BUFFER: Final = 64
"""Statuses between two looks, for the peaks of the currents: a third of a second."""
EVENTS: Final = 200
"""Kept for a page that does not listen."""
STATISTICS_S: Final = 1.0


class HandNews:
    """Gathers what happens to a hand. It only listens.

    Attributes:
        hand: started before or after.
        problem: why it could not be started; empty if it was.
    """

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.problem = ""
        self._statuses: Stream[RobotiqStatus]
        self._transitions: Stream[Transition]
        self._events: deque[Fields] = deque(maxlen=EVENTS)
        self._peaks = [0] * len(hand.model.axes)
        self._fault = Fault.NONE
        self._counted_at = 0.0
        self.open()

    def open(self) -> None:
        """Listen from now on: a stream ends when its hand is stopped."""
        self._statuses = self.hand.statuses(BUFFER)
        self._transitions = self.hand.transitions()

    def gather(self) -> None:
        """Take in what has happened; to be called often."""
        for status in self._statuses.drain():
            currents = [status.current_ma(axis) for axis in status.model.axes]
            self._peaks = [max(pair) for pair in zip(self._peaks, currents, strict=True)]
            if status.fault != self._fault:
                self._fault = status.fault
                self._events.append(_stamped(fault_fields(status)))
        for transition in self._transitions.drain():
            # Every command is a transition to RUNNING_CC and back: they would drown the rest.
            if State.RUNNING_CC not in (transition.source, transition.target):
                self._events.append(_stamped(transition_fields(transition)))

    def take(self, index: int) -> Fields:
        """Everything that is to be told now; the events are told once.

        Args:
            index: of the hand, for the page.
        """
        fields: Fields = {
            "hand": index,
            "state": self.hand.state.name,
            "problem": self.problem,
            "peaks": self._peaks,
            "events": list(self._events),
            **self._newest(),
            **dict(self._statistics()),
        }
        self._events.clear()
        self._peaks = [0] * len(self._peaks)
        return fields

    def _newest(self) -> Fields:
        try:
            status = self.hand.status
        except NotStartedError:
            return {}
        return {
            "model": status.model.name,
            "registers": status.registers,
            "timestamp": status.timestamp,
            "sequence": status.sequence,
            "age": max(now() - status.timestamp, 0.0),
        }

    def _statistics(self) -> Iterator[tuple[str, Fields]]:
        """Now and then: percentiles are dear."""
        if now() - self._counted_at >= STATISTICS_S:
            self._counted_at = now()
            yield "statistics", self.hand.statistics.as_dict()


def _stamped(fields: Fields) -> Fields:
    """With the time of day: the clock of the hand means nothing to a person."""
    return {**fields, "time": time.time() - max(now() - fields["timestamp"], 0.0)}
