"""Pace: selects statuses for publishing at a lower rate than theirs."""

from __future__ import annotations

import math


class Pace:
    """Selects the statuses that are due. After a gap it continues from there, without catching up.

    Args:
        rate: statuses per second.
    """

    def __init__(self, rate: float) -> None:
        self._period = 1 / rate
        self._due = -math.inf

    def takes(self, timestamp: float) -> bool:
        """Whether the status of this time, in monotonic seconds, is due."""
        if timestamp < self._due:
            return False
        self._due += self._period
        if self._due <= timestamp:
            self._due = timestamp + self._period
        return True
