"""Opens the link of a hand, at its start and after a loss, until it is open or given up."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import replace
from typing import Final

import anyio

from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from .options import HandOptions, ReconnectPolicy

SHORTEST_S: Final = 0.01  # between two tries


class Opener:
    """Tries until the link is open. :meth:`end` ends that at any moment, and for good.

    ``connect`` is one try, and raises RobotiqConnectionError when it fails.
    """

    def __init__(self, connect: Callable[[], Awaitable[None]], options: HandOptions) -> None:
        self._connect = connect
        self._options = options
        self._log = options.log
        self._loop = asyncio.get_running_loop()
        self._has_ended = False
        self._scope: anyio.CancelScope | None = None

    def end(self) -> None:
        """Try no more; a try that is under way is cancelled. Never blocks."""
        self._has_ended = True
        if self._scope is not None:
            self._scope.cancel()

    async def first(self, wait: float) -> bool:
        """Open the link of a hand that starts; False when that was ended meanwhile.

        Raises:
            RobotiqConnectionError: the last try has failed.
        """
        told = ""

        def tell(error: RobotiqConnectionError) -> None:
            nonlocal told
            if str(error) != told:
                told = str(error)
                self._log.warning("no gripper yet, trying for %g s: %s", wait, told)

        policy = replace(self._options.policy or ReconnectPolicy(), give_up_after=wait)
        try:
            return await self._open(policy, tell)
        except (ResponseTimeoutError, ConnectionLostError) as error:
            why = f"connected, but no device answers: {error}"
            raise ConnectFailedError(self._options.link.address, why) from error

    async def again(self, policy: ReconnectPolicy) -> bool:
        """Open a link that was lost; False when that was ended meanwhile.

        Raises:
            RobotiqConnectionError: the last try has failed.
        """
        return await self._open(
            policy, lambda error: self._log.debug("still no link: %s", error), policy.first_delay
        )

    async def _open(
        self,
        policy: ReconnectPolicy,
        failed: Callable[[RobotiqConnectionError], None],
        delay: float | None = None,
    ) -> bool:
        """Try; ``failed`` is called with the error of each try but the last, which is raised."""
        backoff = Backoff(policy, self._loop.time())
        while not self._has_ended:
            try:
                with anyio.CancelScope() as self._scope:
                    if delay is not None:
                        await asyncio.sleep(delay)
                    await self._connect()
                    return True
            except RobotiqConnectionError as error:
                if backoff.gives_up(self._loop.time()):
                    raise
                failed(error)
                delay = backoff.delay
        return False


class Backoff:
    """The delays of one attempt to get a link back.

    Attributes:
        since: when the link was lost, in seconds of the caller's clock.
        delay: seconds until the next try.
    """

    def __init__(self, policy: ReconnectPolicy, since: float) -> None:
        self._policy = policy
        self.since = since
        self.delay = policy.first_delay

    def gives_up(self, now: float) -> bool:
        """Whether the try that has just failed was the last one. If not, lengthen the delay.

        The last try begins when ``give_up_after`` is over, and no later.
        """
        limit = self._policy.give_up_after
        self.delay = min(max(2 * self.delay, SHORTEST_S), self._policy.max_delay)
        if limit is None:
            return False
        left = self.since + limit - now
        self.delay = min(self.delay, max(left, 0.0))
        return left <= 0
