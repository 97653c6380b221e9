"""The silence between two frames of a serial line, which ends the first of them.

Modbus RTU ends a frame at a silence of 3.5 characters, 0.30 ms at 115200 baud. For rates above 19200 baud the
standard recommends 1.75 ms instead, to spare receivers interrupts (Modbus over Serial Line 2.5.1.1). The
vendor's software keeps almost none: 3574 of 3600 of its requests came sooner than 1.65 ms after the reply.
So a link begins with 3.5 characters, and takes the longer silence for a device that is seen to need it.
"""

from __future__ import annotations

import asyncio
import math
import time
from collections.abc import Callable
from typing import Final

SHORT_CHARACTERS: Final = 3.5
LONG_S: Final = 0.00175
TIMER_S: Final = 0.001
"""The timers of a loop are no finer: epoll rounds up to whole milliseconds. The rest of a silence is spent
waiting without giving up the turn."""
IS_COARSE: Final = time.get_clock_info("monotonic").resolution > TIMER_S
"""Windows before Python 3.13 counts in steps of 15.6 ms: waiting for the next would hold up the loop."""


class Silence:
    """Keeps the silence before the next frame of a line, over all its connections.

    Attributes:
        heard: when the last bytes arrived, by the clock of the event loop.
        short_s: seconds of the short silence; 0 where this end keeps none, as a serial server keeps its own.
        is_short: whether that has been enough so far.
    """

    def __init__(self, character_s: float) -> None:
        """Begin with the short silence; a character takes ``character_s`` seconds, 0 for no silence."""
        self.short_s: Final = SHORT_CHARACTERS * character_s
        self.heard: float = -math.inf
        self.is_short: bool = character_s > 0

    def hear(self, now: float) -> None:
        """Bytes have arrived."""
        self.heard = now

    def lengthen(self) -> None:
        """This line needs the longer silence."""
        self.is_short = False

    async def keep(self, clock: Callable[[], float], *, is_long: bool = False) -> None:
        """Wait until the line has been silent for long enough, or for the longer time; at once if it has.

        ``clock`` is that of the event loop (``clock_of``). uvloop's own ``time()`` counts whole milliseconds.
        """
        until = self.heard + (self.short_s if self.is_short and not is_long else max(LONG_S, self.short_s))
        left = until - clock()
        # Virtual time passes only in the loop, and its timers are exact.
        by_looking_s = 0.0 if clock is not time.monotonic or IS_COARSE else TIMER_S
        if left > by_looking_s:
            await asyncio.sleep(left - by_looking_s)
        while by_looking_s and clock() < until:
            pass
