"""ReplySender: sends replies from a thread of its own.

A reply takes the priority and the congestion control of its query, which the client chooses. Sending one to
a client that does not read can block until the connection is closed; the event loop must not wait for that.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Final

MOST: Final = 1000
"""Replies that may wait. Beyond it the query is dropped, which happens in the thread too: zenoh tells the
client of it, so it can block as long. Clients repeat their requests."""


class ReplySender:
    """One thread, started with the first answer."""

    def __init__(self) -> None:
        self._waiting: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def put(self, send: Callable[[], None], drop: Callable[[], None]) -> None:
        """Send a reply after those before it, or drop its query if too many wait."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotiq_async fleet", daemon=True)
            self._thread.start()
        self._waiting.put(send if self._waiting.qsize() < MOST else drop)

    def close(self) -> None:
        """Send what waits, then end the thread."""
        self._waiting.put(None)

    def join(self, timeout: float) -> None:
        """Wait for the end of the thread; blocks."""
        if self._thread is not None:
            self._thread.join(timeout)

    def _run(self) -> None:
        while (send := self._waiting.get()) is not None:
            send()
