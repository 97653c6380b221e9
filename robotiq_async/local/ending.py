"""The end of a run: the strongest stop that was requested, and the time for it."""

from __future__ import annotations

from collections.abc import Awaitable, Callable
from typing import Final

from ..runtime.limit import Limit
from ..runtime.logger import Log
from ..values.enums import StopLevel

STOP_S: Final = 1.4
"""From stop() to the disconnection at the latest. stop() promises 2 s, and a tunnel may take half a
second to close. Like every limit it counts while the loop runs: a stop is tried at least once."""
IN_FLIGHT_S: Final = 0.9
"""Of STOP_S: how long the exchange in flight may take before the link is closed and reopened."""


class Ending:
    """The ladder of stops: each level is carried out, then the link is closed, until no stronger one came.

    Attributes:
        level: the strongest so far.
    """

    def __init__(self, level: StopLevel, log: Log) -> None:
        self.level: StopLevel = level
        self._log: Final = log
        self._limit: Final = Limit(STOP_S, shield=True)

    def strengthen(self, level: StopLevel) -> bool:
        """Take in another stop; returns whether it is stronger, and so gets the full time again."""
        if level > self.level:
            self._log.info("a stronger stop came: the fingers are %s", level.done)
            self.level = level
            self._limit.restart(STOP_S)
            return True
        if level < self.level:
            self._log.warning(self.level.prevails)
        return False

    async def carry_out(
        self, stop: Callable[[], Awaitable[None]], close: Callable[[], Awaitable[None]]
    ) -> None:
        """Stop the fingers and close the link; again if a stronger stop comes meanwhile."""
        done = StopLevel.LEAVE
        while True:
            try:
                while done < self.level:
                    done = self.level
                    with self._limit:
                        await stop()
                    if self._limit.is_over:
                        self._log.warning("the gripper did not confirm in time that the fingers were stopped")
            finally:
                self._limit.stop()
                await close()
            if done == self.level:
                return
