"""UnaskedGoals: goals whose result no client has requested yet. Does not import ROS."""

# In ROS a client requests the result of a goal separately, after the goal was accepted. If the
# request comes after the end of the node, the client waits forever, so the end waits for these requests.

from __future__ import annotations

import asyncio
import math
from contextlib import suppress
from typing import Final

from ...runtime import now

ASKING_S: Final = 3.0
"""Seconds after the end of a goal in which its client may request the result. On a busy machine requests came
0.3 s after they had been sent; a launch kills its nodes 10 s after the first signal."""


class UnaskedGoals:
    """The accepted goals whose result no client has requested yet. Belongs to the event loop."""

    def __init__(self) -> None:
        self._until: dict[bytes, float] = {}  # when the end of the node no longer waits for it, by its key
        self._requested = asyncio.Event()

    @property
    def number(self) -> int:
        """How many goals :meth:`wait` would wait for."""
        return sum(until > now() for until in self._until.values())

    def accepted(self, key: bytes) -> None:
        self._until = {each: until for each, until in self._until.items() if until > now()}
        self._until[key] = math.inf

    def ended(self, key: bytes) -> None:
        if key in self._until:
            self._until[key] = now() + ASKING_S

    def requested(self, key: bytes) -> None:
        self._until.pop(key, None)
        self._requested.set()

    async def wait(self) -> None:
        """Wait until a client has requested each result, or until ASKING_S after the last goal has ended."""
        at_most = now() + ASKING_S  # also for a goal that has not ended, because the executor hangs
        with suppress(TimeoutError):
            while self._until:
                self._requested.clear()
                async with asyncio.timeout(min(at_most, max(self._until.values())) - now()):
                    await self._requested.wait()
