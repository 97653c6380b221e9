"""A stop that a lost link kept from the gripper: sent when the link is back."""

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

PENDING_S: Final = 60.0
"""By then every motion has ended that ran when the link was lost; the longest is an automatic release."""
RETRY_S: Final = 0.05
"""Between two attempts."""
_REACHED: Final = tuple(set(State) - {State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN})


class PendingStop:
    """Sends the stop as soon as the link is back. A stop moves nothing, so it may come late."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_pending(self) -> bool:
        """Whether a stop still has to reach the gripper."""
        return bool(self._tasks)

    def schedule(self, stop: Callable[[], Awaitable[None]]) -> None:
        """Await a stop when the link is back, within PENDING_S.

        Args:
            stop: raises RobotiqConnectionError if the link is down again.
        """
        task = asyncio.ensure_future(self._send(stop, now() + PENDING_S))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def cancel(self) -> None:
        """Give the stop up: the hand itself has been stopped."""
        for task in self._tasks:
            task.cancel()
        await asyncio.gather(*self._tasks, return_exceptions=True)

    async def _send(self, stop: Callable[[], Awaitable[None]], until: float) -> None:
        while (left := until - now()) > 0:
            try:
                await self._hand.wait_for_state(*_REACHED, timeout=left)
                await stop()
            except RobotiqConnectionError:
                await asyncio.sleep(RETRY_S)
            except (NotStartedError, StateTimeoutError, ControlLostError):
                return  # the end of the hand stops it, as does the end of a lease; or it is too late
            except RobotiqError as error:
                Log(self._hand.name).error("the link is back, and the fingers MAY STILL MOVE: %s", error)
                return
            else:
                Log(self._hand.name).warning("the link is back, and what still moved has been stopped")
                return
