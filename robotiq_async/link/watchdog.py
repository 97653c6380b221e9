"""Tells when an exchange takes too long, at no cost for those that do not."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Callable
from typing import Final

HELD_S: Final = 0.01
"""A timer, or a tick, that comes so late was kept from coming: the loop was held up."""
GRACE_S: Final = 0.02
"""A peer in the same loop (the simulated gripper) was held up with it, and gets so much more time."""


class Watchdog:
    """Watches one exchange at a time.

    Setting a timer for each exchange and cancelling it costs more than the exchange's own Python. So one
    timer stands until it expires, and then looks when the exchange of that moment is due.
    """

    def __init__(
        self,
        loop: asyncio.AbstractEventLoop,
        seconds: float,
        is_waiting: Callable[[], bool],
        too_long: Callable[[], None],
    ) -> None:
        """Prepare; watches nothing yet.

        Args:
            loop: runs.
            seconds: for one exchange.
            is_waiting: whether an exchange is under way.
            too_long: is called when it is not over in time.
        """
        self._loop = loop
        self._seconds = seconds
        self._is_waiting = is_waiting
        self._too_long = too_long
        self._due = 0.0
        self._has_grace = False
        self._timer: asyncio.TimerHandle | None = None

    def watch(self, by: float = math.inf) -> None:
        """An exchange begins; ``by`` is when it must be over at the latest, in the loop's time."""
        self._due = min(self._loop.time() + self._seconds, by)
        self._has_grace = False
        if self._timer is not None and self._timer.when() > self._due:
            self.stop()
        if self._timer is None:
            self._timer = self._loop.call_at(self._due, self._look, self._due)

    def stop(self) -> None:
        """Watch no longer."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.cancel()

    def _look(self, when: float) -> None:
        """The timer has expired.

        A loop that was held up reads before it looks at its timers: a reply that was waiting is in time.
        """
        self._timer = None
        if not self._is_waiting():
            return
        now = self._loop.time()
        if now >= self._due and now - when > HELD_S and not self._has_grace:
            self._due, self._has_grace = now + GRACE_S, True
        if now < self._due:
            self._timer = self._loop.call_at(self._due, self._look, self._due)
        else:
            self._too_long()
