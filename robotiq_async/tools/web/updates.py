"""Updates for a page about a hand: the newest status, and the events since the last update."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator
from itertools import zip_longest
from typing import Final

from ...hand import Hand
from ...runtime.clock import now
from ...values.errors import NotStartedError
from ...values.status import RobotiqStatus
from ..recording.payloads import Fields, is_command
from ..recording.timeline import Timeline

BUFFER: Final = 64
"""Statuses between two calls of gather(), for the peaks of the currents: a third of a second."""
EVENTS: Final = 200
"""Events kept for a page that does not read."""
STATISTICS_S: Final = 1.0


class HandUpdates:
    """Collects what happens to a hand. It only listens.

    Attributes:
        hand: may be started later.
        problem: why the hand could not be started; empty if it was.
    """

    def __init__(self, hand: Hand) -> None:
        self.hand = hand
        self.problem = ""
        self._timeline = Timeline(hand, BUFFER)
        self._events: deque[Fields] = deque(maxlen=EVENTS)
        self._peaks = [0] * len(hand.model.axes)
        self._counted_at = 0.0

    def open(self) -> None:
        """Listen again after a stop of the hand."""
        self._timeline.open()

    def gather(self) -> None:
        """Collect what is new; call it often."""
        for at, each in self._timeline.new():
            if isinstance(each, RobotiqStatus):
                currents = map(each.current_ma, each.model.axes)
                self._peaks = [max(pair) for pair in zip_longest(self._peaks, currents, fillvalue=0)]
            elif not is_command(each):
                self._events.append({**each, "time": at})

    def take(self, index: int) -> Fields:
        """The next update. It contains each event once.

        Args:
            index: number of the hand on the page.
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
        # Once a second: percentiles are expensive.
        if now() - self._counted_at >= STATISTICS_S:
            self._counted_at = now()
            yield "statistics", self.hand.statistics.as_dict()
