"""Mailbox: carries what zenoh's threads bring into the event loop."""

from __future__ import annotations

import asyncio
import contextlib
import time
from collections import deque
from collections.abc import Callable
from enum import Enum
from typing import Final

from ...runtime.log import log
from ..limited_log import EVERY_S, LimitedLog

GATHER_S: Final = 0.001
"""How long news are gathered where they come thick and fast."""
TURN_S: Final = 0.002
"""How long deliveries are made in one turn of the loop: the rest of the program has its turn, too."""
MOST: Final = 2000
"""At most this many requests and news may lie there; the rest is dropped, as on a network that is full."""


class Kind(Enum):
    """What a delivery is."""

    HALT = "halt"
    """Opened before all others."""
    ANSWER = "answer"
    """To something of ours: never dropped."""
    REQUEST = "request"
    TELEMETRY = "telemetry"
    """May wait for a millisecond."""


class Mailbox:
    """Letters, in their order but for halts.

    Waking the loop costs more than handling a status. Where news come thick and fast, from dozens of hands,
    it wakes for those of a millisecond at once; nothing else waits for that, nor do the news of one hand.
    """

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._halts: deque[Callable[[], None]] = deque()
        self._deliveries: deque[Callable[[], None]] = deque()
        self._is_due = False
        self._gathering: asyncio.TimerHandle | None = None
        self._opened_at = 0.0
        self._dropped = 0
        self._report_due = 0.0
        self._failed = LimitedLog()

    def put(self, delivery: Callable[[], None], kind: Kind) -> bool:
        """Have something called in the loop. From any thread. Returns whether there was room for it."""
        deliveries = self._halts if kind is Kind.HALT else self._deliveries
        if kind is Kind.ANSWER or len(deliveries) < MOST:
            deliveries.append(delivery)
        else:
            self._dropped += 1
            return False
        if not self._is_due or (kind is not Kind.TELEMETRY and self._gathering is not None):
            self._is_due = True
            with contextlib.suppress(RuntimeError):  # the loop has been closed
                self._loop.call_soon_threadsafe(self._open)
        return True

    def _open(self) -> None:
        if self._gathering is not None:
            self._gathering.cancel()
        self._is_due, self._gathering = False, None
        before, self._opened_at = self._opened_at, self._loop.time()
        self._report_dropped()
        count, until = 0, time.perf_counter() + TURN_S
        while self._halts or self._deliveries:
            delivery = (self._halts or self._deliveries).popleft()
            count += 1
            try:
                delivery()
            except Exception:  # noqa: BLE001  # the next delivery is another's
                self._failed.warn("handling a fleet message failed", exc_info=True)
            if time.perf_counter() > until:
                break
        if (self._halts or self._deliveries) and not self._is_due:
            self._is_due = True
            self._loop.call_soon(self._open)
        elif count and not self._is_due and self._opened_at - before < 2 * GATHER_S:
            self._is_due = True
            self._gathering = self._loop.call_later(GATHER_S, self._open)

    def _report_dropped(self) -> None:
        if self._dropped and self._loop.time() >= self._report_due:
            dropped, self._dropped = self._dropped, 0
            self._report_due = self._loop.time() + EVERY_S
            log.warning("%d fleet messages dropped: queue full", dropped)
