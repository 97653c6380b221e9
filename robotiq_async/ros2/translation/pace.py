"""Which of the statuses are published, at a rate that is lower than theirs."""

from __future__ import annotations

import math


class Pace:
    """Takes those that are due. After a gap it goes on from there, and makes up for nothing."""

    def __init__(self, rate: float) -> None:
        """Take the first one.

        Args:
            rate: so many a second.
        """
        self._period = 1 / rate
        self._due = -math.inf

    def takes(self, timestamp: float) -> bool:
        """Whether a status of this time is due, in monotonic seconds."""
        if timestamp < self._due:
            return False
        self._due += self._period
        if self._due <= timestamp:
            self._due = timestamp + self._period
        return True
