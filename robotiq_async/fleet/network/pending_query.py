"""PendingQuery: a query without a result yet. Several processes may reply to it; one reply is the result."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from .bus import Reply


class PendingQuery:
    """Waits for the reply that decides; without such a reply, the result is the last one.

    Attributes:
        answered: the reply; None if none came.
    """

    def __init__(self, decides: Callable[[Reply], bool]) -> None:
        self.answered: asyncio.Future[Reply | None] = asyncio.get_running_loop().create_future()
        self._decides = decides
        self._last: Reply | None = None

    def take(self, reply: Reply) -> None:
        if not self.answered.done():
            self._last = reply
            if self._decides(reply):
                self.answered.set_result(reply)

    def end(self) -> None:
        """No more replies will come."""
        if not self.answered.done():
            self.answered.set_result(self._last)
