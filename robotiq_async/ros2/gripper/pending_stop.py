"""PendingStop: a stop that could not be sent while the link was down, and is sent when it is back."""

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
"""Seconds after which every motion from before the loss has ended; the longest is an automatic release."""
RETRY_S: Final = 0.05
"""Seconds between two attempts."""
_REACHED: Final = tuple(set(State) - {State.DISCONNECTED, State.DO_SHUTDOWN, State.SHUTDOWN})


class PendingStop:
    """Sends the stop as soon as the link is back. A stop moves nothing, so it may be late."""

    def __init__(self, hand: Hand) -> None:
        self._hand = hand
        self._tasks: set[asyncio.Task[None]] = set()

    @property
    def is_pending(self) -> bool:
        return bool(self._tasks)

    def schedule(self, stop: Callable[[], Awaitable[None]]) -> None:
        """Send a stop when the link is back, within PENDING_S; again after RobotiqConnectionError."""
        task = asyncio.ensure_future(self._send(stop, now() + PENDING_S))
        self._tasks.add(task)
        task.add_done_callback(self._tasks.discard)

    async def cancel(self) -> None:
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
                return  # the hand or its lease has ended, which stops the fingers; or it is too late
            except RobotiqError as error:
                Log(self._hand.name).error("the link is back, and the fingers MAY STILL MOVE: %s", error)
                return
            else:
                Log(self._hand.name).warning("the link is back, and what still moved has been stopped")
                return
