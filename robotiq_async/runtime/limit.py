"""Limits of time that count only while the event loop runs.

A loop that is held up (a blocking call, a debugger, a suspended process) hears nothing. A limit that passed
meanwhile would report a device as silent that answered long ago.
"""

# Theory of operation
#
# The end is a point in time. Until then the limit looks at the clock every SLICE_S: a look that comes late
# moves the end by its lateness. So a block counts for a slice at most, and a limit without one ends exactly.
#
# The time that is left after a block may be too short for the answers that wait in the sockets. So at least
# GRACE_S are left. That is given once: a limit must end, too, in a loop that is held up again and again.

from __future__ import annotations

import asyncio
import math
from types import TracebackType
from typing import Final, Self

import anyio

from .clock import resolution_of

HELD_S: Final = 0.01  # a timer or tick that fires this late shows that the event loop was held up
SLICE_S: Final = 0.1  # between two looks at the clock
LIMIT_GRACE_S: Final = 0.25
"""A poll or two on a slow line (0.1 s each)."""


class Limit:
    """A block that is cancelled when the event loop has run for some seconds.

    The time counts from the making or from :meth:`restart`, also before the block is entered. A block that is
    entered too late gets the time of grace: its work is tried once. It may be entered again.

    Args:
        seconds: None for no limit.
        shield: whether only this limit ends the block, and no cancellation of its task.

    Attributes:
        is_over: whether the last block was ended by the limit.
    """

    def __init__(self, seconds: float | None = None, *, shield: bool = False) -> None:
        self.is_over: bool = False
        self._loop: Final = asyncio.get_running_loop()
        self._is_shield: Final = shield
        self._scope: anyio.CancelScope | None = None
        self._end = math.inf
        self._look_at = math.inf  # the time of the next look
        self._timers: list[asyncio.Handle] = []  # for the end, and for the look
        self._has_grace = False
        self.restart(seconds)

    def __enter__(self) -> Self:
        self.is_over = False
        self._scope = anyio.CancelScope(shield=self._is_shield)
        self._scope.__enter__()
        if self.left <= 0:
            self.restart(LIMIT_GRACE_S)
        elif not self._timers:
            self._wait()
        return self

    def __exit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> bool:
        self.stop()
        scope, self._scope = self._scope, None
        assert scope is not None, "entered"
        is_caught = bool(scope.__exit__(kind, error, trace))
        self.is_over = scope.cancelled_caught
        return is_caught

    @property
    def left(self) -> float:
        """Seconds until the end; below 0 after it, and infinite without a limit."""
        if self._is_late():
            self._skip_block()  # the look that is due comes after this task
        return self._end - self._loop.time()

    def restart(self, seconds: float | None) -> None:
        """Let the time count from now."""
        self._end = math.inf if seconds is None else self._loop.time() + seconds
        self._has_grace = False
        self._wait()

    def stop(self) -> None:
        """Look no more, until the block is entered again or the limit restarted."""
        for timer in self._timers:
            timer.cancel()
        self._timers.clear()
        self._look_at = math.inf

    def _wait(self) -> None:
        self.stop()
        if self._end < math.inf:
            # Not by the last look: timers that are due together run in the order in which they were set.
            self._timers.append(self._loop.call_at(self._end, self._expire))
            self._wait_for_look()

    def _wait_for_look(self) -> None:
        self._look_at = min(self._end, self._loop.time() + SLICE_S)
        if self._look_at < self._end:
            self._timers[1:] = [self._loop.call_at(self._look_at, self._look)]

    def _look(self) -> None:
        if self._is_late():
            self._skip_block()
        else:
            self._wait_for_look()

    def _expire(self) -> None:
        if self._is_late() and not self._has_grace:
            self._skip_block()
            return
        self.stop()
        if self._scope is not None:
            self._scope.cancel()

    def _is_late(self) -> bool:
        return self._loop.time() - self._look_at > HELD_S + resolution_of(self._loop)

    def _skip_block(self) -> None:
        """Move the end by the time for which the loop was held up."""
        now = self._loop.time()
        self._end += now - self._look_at
        if self._end < now + LIMIT_GRACE_S and not self._has_grace:
            self._end, self._has_grace = now + LIMIT_GRACE_S, True
        self._wait()
