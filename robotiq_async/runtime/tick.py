"""Wakes the poller tasks of a loop, each at its own absolute deadlines.

A loop's own timers are too coarse for 200 Hz: epoll rounds their timeouts up to a millisecond, and uvloop's
clock counts milliseconds. On Linux the kernel therefore keeps the next deadline, in a timerfd that the loop
watches like a socket. Elsewhere, and in a loop with its own clock, the loop's timers keep it. All hands of a
loop share one timer, so all pollers that are due wake together, and many hands do not wake a busy loop more
often.

On Windows fine_waits.py makes waits finer. Where the clock counts in steps of 15.6 ms (Windows
before Python 3.13), an interval is at least a tenth longer than a step: no tick is promised that cannot come.

A missed tick is counted and not caught up with. The delay of a tick is the time for which the loop was held
up; it does not depend on the poller task.
"""

from __future__ import annotations

import asyncio
import contextlib
import heapq
import math
import time
from typing import ClassVar, Final, Literal

from . import fine_waits
from .clock import clock_of, resolution_of
from .limit import HELD_S
from .timerfd import TimerFd

Source = Literal["timerfd", "loop timer"]

_GOLDEN: Final = (math.sqrt(5) - 1) / 2
_STEPS: Final = 1.1
"""Steps of the clock in an interval, at least. Windows cuts its steps of 15.6 ms to 15 or 16: in an interval
longer than each no two ticks come in one step."""


class Tick:
    """A periodic tick for one task. :meth:`close` it at the end. Making one needs a running event loop.

    Attributes:
        interval: seconds between ticks; longer than requested if the clock's step is too coarse.
        time: the clock of the deadlines.
        due: the next deadline.
        late: the longest delay in seconds of the ticks that have passed since the last wait. A delay within a
            step of the clock counts as none.
        longest_late: the longest delay so far.
        held_up_at: the time of the last tick that was so late that the loop was held up before it.
    """

    def __init__(self, interval: float) -> None:
        self._loop = asyncio.get_running_loop()
        self._timer: _LoopTimer | None = None
        self._step = resolution_of(self._loop)
        self.interval: Final = max(interval, _STEPS * self._step)
        self.time: Final = clock_of(self._loop)
        self.due: float = 0.0
        self.late: float = 0.0
        self.longest_late: float = 0.0
        self.held_up_at: float = -math.inf
        self._passed = 0
        self._hurried = False
        self._waiter: asyncio.Future[None] | None = None

    def start(self) -> None:
        """Start or restart: the next tick comes within an interval."""
        self.close()
        self._timer = timer = _LoopTimer.of(self._loop)
        phase = self.interval * timer.next_phase()
        self.due = math.ceil((self.time() - phase) / self.interval) * self.interval + phase
        self._passed, self._hurried = 0, False
        timer.add(self)

    def close(self) -> None:
        """Stop ticking. Idempotent."""
        timer, self._timer = self._timer, None
        if timer is not None:
            timer.remove(self)

    @property
    def source(self) -> Source | Literal[""]:
        """The timer that keeps the deadlines; empty before the start."""
        return "" if self._timer is None else self._timer.source

    @property
    def is_awaited(self) -> bool:
        """Whether its reader waits, or was woken and has not run yet."""
        return self._waiter is not None

    def hurry(self) -> None:
        """End the next wait at once; the ticks keep their deadlines."""
        self._hurried = True
        self._wake()

    async def wait(self) -> int:
        """Wait for the next tick; return how many have passed since the last wait.

        That is 1, more if ticks were missed, and 0 if :meth:`hurry` ended the wait.
        """
        while not self._passed and not self._hurried:
            self._waiter = self._loop.create_future()
            await self._waiter
            self._waiter = None
        passed, self._passed, self._hurried = self._passed, 0, False
        return passed

    def expire(self, now: float) -> None:
        """Count the deadline, and any further ones, that have passed; set the next."""
        passed = now - self.due
        late = passed - self._step
        if late > self.late or not self._passed:
            self.late = late
        if late > self.longest_late:
            self.longest_late = late
        if late > HELD_S:
            self.held_up_at = now
        count = 1 + int(passed / self.interval)
        self.due += count * self.interval
        self._passed += count
        self._wake()

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)


class _LoopTimer:
    """The timer that all ticks of one loop share, while there are any."""

    _timers: ClassVar[dict[asyncio.AbstractEventLoop, _LoopTimer]] = {}
    """Threads start and end loops at any time: the thread that pops a timer from here releases it."""

    @classmethod
    def of(cls, loop: asyncio.AbstractEventLoop) -> _LoopTimer:
        """The timer of a loop; releases the timers of loops that were closed under their ticks."""
        for each in list(cls._timers):
            if each.is_closed() and (left := cls._timers.pop(each, None)) is not None:
                left.release()
        timer = cls._timers.get(loop)
        if timer is None:
            timer = cls._timers[loop] = cls(loop)
        return timer

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._added = 0
        self._heap: list[tuple[float, int, Tick]] = []
        self._handle: asyncio.TimerHandle | None = None
        self._clock = clock_of(loop)
        self._step = resolution_of(loop)
        self._timerfd = self._watched_timerfd()
        if self._timerfd is None:
            fine_waits.begin()

    @property
    def source(self) -> Source:
        return "loop timer" if self._timerfd is None else "timerfd"

    def next_phase(self) -> float:
        """The phase of the next tick in its interval, 0..1, so that the hands do not all send at once.

        The fractional parts of multiples of the golden ratio spread evenly for any number of hands.
        """
        return self._added * _GOLDEN % 1

    def add(self, tick: Tick) -> None:
        self._added += 1
        heapq.heappush(self._heap, (tick.due, self._added, tick))
        self._arm()

    def remove(self, tick: Tick) -> None:
        self._heap = [each for each in self._heap if each[2] is not tick]
        heapq.heapify(self._heap)
        if not self._heap:
            self._close()

    def _expire_due(self) -> None:
        heap, now = self._heap, self._clock()
        while heap and heap[0][0] <= now:
            _, number, tick = heap[0]
            tick.expire(now)
            heapq.heapreplace(heap, (tick.due, number, tick))
        self._arm()

    def _arm(self) -> None:
        due = self._heap[0][0]
        if self._timerfd is not None:
            self._timerfd.arm(due)
            return
        if self._handle is not None:
            self._handle.cancel()
        # The loop calls timers that are due within a step of its clock. A deadline in this step has not
        # passed before the next step: the timer would be called and armed again and again until then.
        if due > (now := self._clock()):
            due = max(due, now + self._step)
        self._handle = self._loop.call_at(due, self._expire_due)

    def _watched_timerfd(self) -> TimerFd | None:
        """A timerfd that the loop watches; None without timerfd, or if the loop has its own clock."""
        if self._clock is not time.monotonic:
            return None
        with contextlib.suppress(OSError, NotImplementedError):
            timer = TimerFd()
            try:
                self._loop.add_reader(timer.descriptor, self._expire_due)
            except BaseException:
                timer.close()
                raise
            return timer
        return None

    def _close(self) -> None:
        if self._timers.pop(self._loop, None) is None:
            return  # another thread has released it
        if self._timerfd is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._timerfd.descriptor)
        if self._handle is not None:
            self._handle.cancel()
        self.release()

    def release(self) -> None:
        """Close the descriptor, which the loop no longer watches, or end the fine waits."""
        if self._timerfd is not None:
            self._timerfd.close()
        else:
            fine_waits.end()
