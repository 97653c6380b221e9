"""Pace and Timer: work at a rate. Does not import ROS."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from contextlib import suppress

from ...values import NotStartedError


class Pace:
    """Selects the statuses that are due, ``rate`` per second. After a gap nothing is caught up on."""

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


class Timer:
    """Calls ``work`` at once and then every ``period`` seconds until cancelled. Missed calls are skipped.

    NotStartedError, of a hand that was just stopped, is ignored. ``failed`` is called with any other
    exception; the timer ends then.
    """

    def __init__(
        self, period: float, work: Callable[[], object], failed: Callable[[BaseException], object]
    ) -> None:
        self._loop = asyncio.get_running_loop()
        self._period, self._work, self._failed = period, work, failed
        self._due = self._loop.time()
        self._next = self._loop.call_soon(self._tick)

    def cancel(self) -> None:
        self._next.cancel()

    def _tick(self) -> None:
        try:
            with suppress(NotStartedError):
                self._work()
        except Exception as error:  # noqa: BLE001  # reported to the node, or it would be lost
            self._failed(error)
            return
        self._due += self._period
        if self._due <= self._loop.time():
            self._due = self._loop.time() + self._period
        self._next = self._loop.call_at(self._due, self._tick)
