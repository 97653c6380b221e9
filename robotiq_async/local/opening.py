"""Opens the link of a hand, at its start and after a loss, until it is open or given up."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Final

import anyio

from ..hands.options import HandOptions, ReconnectPolicy
from ..runtime.limit import Limit
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)

SHORTEST_S: Final = 0.01  # between two tries


class Opener:
    """Tries until the link is open. :meth:`end` cancels that at any moment, permanently.

    ``connect`` is one try, and raises RobotiqConnectionError when it fails.
    """

    def __init__(self, connect: Callable[[], Awaitable[None]], options: HandOptions) -> None:
        self._connect = connect
        self._options = options
        self._log = options.log
        self._has_ended = False
        self._scope: anyio.CancelScope | None = None

    def end(self) -> None:
        """Try no more; a try that has begun is cancelled. Never blocks."""
        self._has_ended = True
        if self._scope is not None:
            self._scope.cancel()

    async def first(self, wait: float) -> bool:
        """Open the link of a hand that starts; False if :meth:`end` came first.

        Raises:
            RobotiqConnectionError: the last try has failed.
        """
        tell = self._once_each(f"no gripper yet, trying for {wait:g} s")
        policy = replace(self._options.policy or ReconnectPolicy(), give_up_after=wait)
        try:
            return await self._open(policy, tell)
        except (ResponseTimeoutError, ConnectionLostError) as error:
            why = f"connected, but no device answers: {error}"
            raise ConnectFailedError(self._options.link.address, why) from error

    async def again(self, policy: ReconnectPolicy, failed: Callable[[RobotiqConnectionError], None]) -> bool:
        """Open a link that was lost; False if :meth:`end` came first.

        ``failed`` is called with the error of each try but the last.

        Raises:
            RobotiqConnectionError: the last try has failed.
        """
        tell = self._once_each("still no link")

        def note(error: RobotiqConnectionError) -> None:
            tell(error)
            failed(error)

        return await self._open(policy, note, policy.first_delay)

    def _once_each(self, what: str) -> Callable[[RobotiqConnectionError], None]:
        """Make a function that logs an error if it differs from the one before."""
        told = ""

        def tell(error: RobotiqConnectionError) -> None:
            nonlocal told
            if str(error) != told:
                told = str(error)
                self._log.warning("%s: %s", what, told)

        return tell

    async def _open(
        self,
        policy: ReconnectPolicy,
        failed: Callable[[RobotiqConnectionError], None],
        delay: float | None = None,
    ) -> bool:
        """Try; ``failed`` is called with the error of each try but the last, which is raised."""
        limit = Limit(policy.give_up_after)
        try:
            return await self._try_until(limit, policy, failed, delay)
        finally:
            limit.stop()

    async def _try_until(
        self,
        limit: Limit,
        policy: ReconnectPolicy,
        failed: Callable[[RobotiqConnectionError], None],
        delay: float | None,
    ) -> bool:
        doubled = policy.first_delay
        while not self._has_ended:
            try:
                with anyio.CancelScope() as self._scope:
                    if delay is not None:
                        await asyncio.sleep(delay)
                    await self._connect()
                    return True
            except RobotiqConnectionError as error:
                delay = doubled = min(max(2 * doubled, SHORTEST_S), policy.max_delay)
                if (left := limit.left) < SHORTEST_S:
                    raise
                delay = doubled = min(delay, left)  # the last try begins when the time is over, and no later
                failed(error)
        return False
