"""The one clock of everything that happens to a hand.

Timestamps, durations and ages are seconds of ``time.monotonic()``. asyncio's own loops use it, and so does
uvloop: its ``time()`` is the same in whole milliseconds. A loop with another ``time()`` (virtual
time, in tests) keeps its own time.
"""

from __future__ import annotations

import asyncio
import time
from collections.abc import Callable
from types import FunctionType
from typing import Final

_ASYNCIOS: Final = asyncio.BaseEventLoop.time


def clock_of(loop: asyncio.AbstractEventLoop) -> Callable[[], float]:
    """The clock of a loop: its own if it has one, else ``time.monotonic``."""
    # Comparing the readings of both would not do: they may agree by chance and diverge later.
    method = type(loop).time
    is_own = isinstance(method, FunctionType) and method is not _ASYNCIOS
    return loop.time if is_own or "time" in getattr(loop, "__dict__", ()) else time.monotonic


def resolution_of(loop: asyncio.AbstractEventLoop) -> float:
    """The step of a loop's clock in seconds: asyncio calls timers that are due within it. 0 without a step.

    15.6 ms on Windows before Python 3.13, and else a millionth of a second or less.
    """
    return float(getattr(loop, "_clock_resolution", 0.0))


def now() -> float:
    """The time of the running loop's clock."""
    return clock_of(asyncio.get_running_loop())()
