"""A query on its way, and the replies to it. Several may answer; one reply is waited for."""

from __future__ import annotations

import asyncio
from collections.abc import Callable

from .bus import Reply


class PendingQuery:
    """Waits for the reply that decides; without one, when all have answered, it is the last that came.

    Attributes:
        answered: what came of it; None if nothing did.
    """

    def __init__(self, decides: Callable[[Reply], bool]) -> None:
        self.answered: asyncio.Future[Reply | None] = asyncio.get_running_loop().create_future()
        self._decides = decides
        self._last: Reply | None = None

    def take(self, reply: Reply) -> None:
        """A reply has come."""
        if not self.answered.done():
            self._last = reply
            if self._decides(reply):
                self.answered.set_result(reply)

    def end(self) -> None:
        """No more replies come."""
        if not self.answered.done():
            self.answered.set_result(self._last)
