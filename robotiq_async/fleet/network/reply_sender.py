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
"""Replies that may wait. Beyond that the query is dropped, also in this thread: zenoh notifies the client of
it, which can block for as long. Clients repeat their requests."""


class ReplySender:
    """One thread, started with the first reply."""

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
        """Send the waiting replies, then end the thread."""
        self._waiting.put(None)

    def join(self, timeout: float) -> None:
        # Blocks: call it outside the event loop.
        if self._thread is not None:
            self._thread.join(timeout)

    def _run(self) -> None:
        while (send := self._waiting.get()) is not None:
            send()
