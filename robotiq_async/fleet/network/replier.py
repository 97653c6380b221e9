"""Replier: sends answers from a thread of its own.

An answer goes out with the urgency and the patience that its question came with, which a stranger chooses:
where nobody reads, sending one may take until the link is given up. The event loop must not wait for that.
"""

from __future__ import annotations

import queue
import threading
from collections.abc import Callable
from contextlib import suppress
from typing import Final

MOST: Final = 1000
"""So many answers may wait; the rest is dropped: whoever asked asks again, or gives up."""


class Replier:
    """One thread, started with the first answer. Nobody has to wait for its end."""

    def __init__(self) -> None:
        """Nothing to send yet."""
        self._waiting: queue.Queue[Callable[[], None] | None] = queue.Queue(MOST)
        self._thread: threading.Thread | None = None

    def put(self, send: Callable[[], None]) -> None:
        """Have an answer sent, after those before it."""
        if self._thread is None:
            self._thread = threading.Thread(target=self._run, name="robotiq_async fleet", daemon=True)
            self._thread.start()
        with suppress(queue.Full):
            self._waiting.put_nowait(send)

    def close(self) -> None:
        """Send nothing more; what waits is given up if it cannot be sent at once."""
        with suppress(queue.Full):
            self._waiting.put_nowait(None)

    def _run(self) -> None:
        while (send := self._waiting.get()) is not None:
            send()
