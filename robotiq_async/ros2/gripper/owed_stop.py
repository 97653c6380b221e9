"""A stop that a lost link has kept from the gripper."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Final

from ...hand import Hand
from ...runtime.clock import now
from ...runtime.log import Log
from ...values.enums import State
from ...values.errors import (
    ControlLostError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqError,
    StateTimeoutError,
)

OWED_S: Final = 60.0
"""Later nothing can move any more that was moving when the link was lost: the longest is a release."""
AGAIN_S: Final = 0.05
"""From an attempt that failed to the next one."""
_REACHED: Final = tuple(set(State) - {State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN})


class OwedStop:
    """Makes the stop good as soon as the link is back. A stop is no motion: it may come late."""

    def __init__(self, hand: Hand) -> None:
        """Owe nothing."""
        self._hand = hand
        self._making_good: set[asyncio.Task[None]] = set()

    @property
    def is_owed(self) -> bool:
        """Whether something may move that is to stand."""
        return bool(self._making_good)

    def owe(self, stop: Callable[[], Awaitable[None]]) -> None:
        """Stop what moves when the link is back, if that is soon enough.

        Args:
            stop: does it; raises RobotiqConnectionError if the link is down again.
        """
        task = asyncio.ensure_future(self._make_good(stop, now() + OWED_S))
        self._making_good.add(task)
        task.add_done_callback(self._making_good.discard)

    async def end(self) -> None:
        """Owe nothing any more: the hand is stopped."""
        for task in self._making_good:
            task.cancel()
        await asyncio.gather(*self._making_good, return_exceptions=True)

    async def _make_good(self, stop: Callable[[], Awaitable[None]], until: float) -> None:
        while (left := until - now()) > 0:
            try:
                await self._hand.wait_for_state(*_REACHED, timeout=left)
                await stop()
            except RobotiqConnectionError:
                await asyncio.sleep(AGAIN_S)
            except (NotStartedError, StateTimeoutError, ControlLostError):
                return  # the end of the hand stops it, as does the end of a lease; or it is too late
            except RobotiqError as error:
                Log(self._hand.name).error("the link is back, and the fingers MAY STILL MOVE: %s", error)
                return
            else:
                Log(self._hand.name).warning("the link is back, and what still moved has been stopped")
                return
