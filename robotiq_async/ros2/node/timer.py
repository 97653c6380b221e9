"""Doing something at a rate in the event loop. Needs no ROS."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress

from ...values.errors import NotStartedError


class Timer:
    """Does something at a rate, from now on; what is missed is missed."""

    def __init__(
        self, period: float, work: Callable[[], object], failed: Callable[[BaseException], object]
    ) -> None:
        """Begin at once, in the running loop.

        Args:
            period: seconds.
            work: is done; a hand that was stopped in this moment does not matter.
            failed: is called with what else it raises, and then it ends.
        """
        self._loop = asyncio.get_running_loop()
        self._period, self._work, self._failed = period, work, failed
        self._due = self._loop.time()
        self._next = self._loop.call_soon(self._tick)

    def cancel(self) -> None:
        """End it."""
        self._next.cancel()

    def _tick(self) -> None:
        try:
            with suppress(NotStartedError):
                self._work()
        except Exception as error:  # noqa: BLE001  # whatever it is: nobody else would hear of it
            self._failed(error)
            return
        self._due += self._period
        if self._due <= self._loop.time():
            self._due = self._loop.time() + self._period
        self._next = self._loop.call_at(self._due, self._tick)
