"""Replier: sends answers from a thread of its own.

An answer goes out with the urgency and the patience that its query came with, which a stranger chooses:
where nobody reads, sending one may take until the link is given up. The event loop must not wait for that.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from typing import Final

MOST: Final = 1000
"""At most this many answers may wait; the query of any more is dropped, in the thread as well: that, too,
is told to whoever asked, and may take as long. They ask again, or give up."""


class Replier:
    """One thread, started with the first answer."""

    def __init__(self) -> None:
        """Nothing to send yet."""
        self._waiting: queue.SimpleQueue[Callable[[], None] | None] = queue.SimpleQueue()
        self._thread: threading.Thread | None = None

    def put(self, send: Callable[[], None], drop: Callable[[], None]) -> None:
        """Have an answer sent after those before it, or its query dropped where too many wait."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotiq_async fleet", daemon=True)
            self._thread.start()
        self._waiting.put(send if self._waiting.qsize() < MOST else drop)

    def close(self) -> None:
        """Send what waits, and nothing after it."""
        self._waiting.put(None)

    def join(self, timeout: float) -> None:
        """Wait for the end of the thread; blocks."""
        if self._thread is not None:
            self._thread.join(timeout)

    def _run(self) -> None:
        while (send := self._waiting.get()) is not None:
            send()
