"""What gSTA and gDT were, for a gripper that shows them late."""

from __future__ import annotations

import math
from collections import deque
from typing import NamedTuple

from robotiq_async.values.enums import ObjectStatus

Statuses = tuple[ObjectStatus, ...]


class _Entry(NamedTuple):
    since: float
    statuses: Statuses


class StatusTrail:
    """The object status of each axis over time. Times are simulated seconds and never decrease."""

    def __init__(self, first: Statuses) -> None:
        self._entries = deque([_Entry(-math.inf, first)])

    def note(self, time: float, statuses: Statuses, lag: float) -> None:
        """Add the present value, and drop values older than the lag."""
        if statuses == self._entries[-1].statuses:
            return
        self._entries.append(_Entry(time, statuses))
        while self._entries[1].since <= time - lag:
            self._entries.popleft()
            if len(self._entries) == 1:
                return

    def at(self, time: float) -> Statuses:
        """The value at a time; for a time that is dropped, the oldest value kept."""
        for entry in reversed(self._entries):
            if entry.since <= time:
                return entry.statuses
        return self._entries[0].statuses
