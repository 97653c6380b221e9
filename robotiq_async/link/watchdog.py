"""Detects exchanges that take too long, at almost no cost for those that do not."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Final

from ..runtime.clock import clock_of
from ..runtime.limit import HELD_S

GRACE_S: Final = 0.02
"""Extra time after a block for a peer in the same loop (the simulated gripper), which was blocked as well."""


class Watchdog:
    """Watches one exchange at a time.

    Setting and cancelling a timer for each exchange would cost more than the exchange itself. So one timer
    runs until it expires, and then checks when the exchange of that moment is due.

    Attributes:
        loop: the event loop.
        clock: its time, in finer steps where the loop's own are coarse.
    """

    def __init__(self, on_timeout: Callable[[], None]) -> None:
        """Watch in the running loop. ``on_timeout`` is called for an exchange that has ended, too."""
        self.loop: Final = asyncio.get_running_loop()
        self.clock: Final = clock_of(self.loop)
        self._on_timeout: Final = on_timeout
        self._due = 0.0
        self._has_grace = False
        # The handle of a foreign loop (qasync's) does not give its time, so that is kept beside it.
        self._timer: asyncio.Handle | None = None
        self._timer_due = math.inf  # while there is no timer

    def watch(self, seconds: float, by: float) -> float:
        """Watch an exchange that may take some seconds, and no longer than ``by``; return the time."""
        began = self.clock()
        self._due = began + seconds
        if by < self._due:
            self._due = by
        self._has_grace = False
        if self._timer_due > self._due:
            self.stop()
            self._set_timer()
        return began

    def stop(self) -> None:
        """Stop watching."""
        timer, self._timer = self._timer, None
        self._timer_due = math.inf
        if timer is not None:
            timer.cancel()

    def _look(self, when: float) -> None:
        # After a block asyncio handles sockets before timers, so a reply that was waiting counts as in time.
        self.stop()
        now = self.clock()
        if now >= self._due and now - when > HELD_S and not self._has_grace:
            self._due, self._has_grace = now + GRACE_S, True
        if now < self._due:
            self._set_timer()
        else:
            self._on_timeout()

    def _set_timer(self) -> None:
        self._timer_due = self._due
        self._timer = self.loop.call_at(self._due, self._look, self._due)
