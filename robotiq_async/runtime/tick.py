"""Wakes the poller tasks of a loop, each at absolute deadlines of its own.

A loop's own timers are no good for 200 Hz: epoll rounds their timeouts up to a millisecond, and uvloop's
clock is one. On Linux the next deadline is therefore kept by the kernel, in a timerfd that the running loop
watches like a socket; elsewhere, and in a loop that has a clock of its own, by the loop's timers. All
hands of a loop share one: whoever is due is woken together, and a busy loop is not woken more often for it.

A tick that nobody waits for is counted and not caught up with. How late a tick came tells for how long the
loop was held up, whatever the poller task was doing meanwhile.
"""

from __future__ import annotations

import asyncio
import contextlib
import heapq
import math
import sys
import time
from typing import ClassVar, Final, Literal

from .clock import clock_of
from .timerfd import TimerFd

Source = Literal["timerfd", "loop timer"]

_GOLDEN: Final = (math.sqrt(5) - 1) / 2


class Tick:
    """One steady beat, for one task. :meth:`close` it at the end."""

    def __init__(self, interval: float) -> None:
        """Prepare; must be made inside a running event loop.

        Args:
            interval: seconds between ticks.
        """
        self._loop = asyncio.get_running_loop()
        self._bell: _Bell | None = None
        self.interval: Final = interval
        self.time: Final = clock_of(self._loop)
        """The clock that the deadlines are those of."""
        self.due = 0.0
        """The next deadline."""
        self.late = 0.0
        """How late a tick came, in seconds: the worst since somebody set this to 0."""
        self.longest_late = 0.0
        """The worst of all."""
        self.stood_still = False
        """Whether nobody ran the loop when it came so late, as IPython's terminal between two prompts."""
        self._passed = 0
        self._hurried = False
        self._waiter: asyncio.Future[None] | None = None

    def start(self) -> None:
        """Begin to beat, or begin anew: the next tick comes within an interval."""
        self.close()
        self._bell = bell = _Bell.of(self._loop)
        phase = self.interval * bell.next_phase()
        self.due = math.ceil((self.time() - phase) / self.interval) * self.interval + phase
        self._passed, self._hurried, self.late, self.stood_still = 0, False, 0.0, False
        bell.add(self)

    def close(self) -> None:
        """Beat no more. Idempotent."""
        bell, self._bell = self._bell, None
        if bell is not None:
            bell.remove(self)

    @property
    def source(self) -> Source | Literal[""]:
        """What it beats by."""
        return "" if self._bell is None else self._bell.source

    def hurry(self) -> None:
        """Have the next wait end at once; the ticks come when they would have come."""
        self._hurried = True
        self._wake()

    async def wait(self) -> int:
        """Wait for the next tick, and return how many have passed since the last wait.

        That is 1, more if late, and 0 when :meth:`hurry` ended the wait.
        """
        while not self._passed and not self._hurried:
            self._waiter = self._loop.create_future()
            await self._waiter
        passed, self._passed, self._hurried = self._passed, 0, False
        return passed

    def strike(self, now: float, *, stood_still: bool) -> None:
        """The deadline has passed, and perhaps some more have.

        Args:
            now: the time.
            stood_still: whether the loop was stopped and run again since the last tick.
        """
        late = now - self.due
        if late > self.late:
            self.late, self.stood_still = late, stood_still
            self.longest_late = max(self.longest_late, late)
        count = 1 + int(late / self.interval)
        self.due += count * self.interval
        self._passed += count
        self._wake()

    def _wake(self) -> None:
        if self._waiter is not None and not self._waiter.done():
            self._waiter.set_result(None)


class _Bell:
    """Strikes all ticks of one loop, while there are any."""

    _bells: ClassVar[dict[asyncio.AbstractEventLoop, _Bell]] = {}
    """Loops of several threads come and go at once: whoever takes one out gives it back."""

    @classmethod
    def of(cls, loop: asyncio.AbstractEventLoop) -> _Bell:
        """The timer of a loop; frees those of loops that were closed without notice."""
        for each in list(cls._bells):
            if each.is_closed() and (left := cls._bells.pop(each, None)) is not None:
                left.give_back()
        bell = cls._bells.get(loop)
        if bell is None:
            bell = cls._bells[loop] = cls(loop)
        return bell

    def __init__(self, loop: asyncio.AbstractEventLoop) -> None:
        self._loop = loop
        self._added = 0
        self._heap: list[tuple[float, int, Tick]] = []
        self._handle: asyncio.TimerHandle | None = None
        self._clock = clock_of(loop)
        self._run = _this_run()
        self._timerfd = self._watched_timerfd()

    @property
    def source(self) -> Source:
        return "loop timer" if self._timerfd is None else "timerfd"

    def next_phase(self) -> float:
        """Where in its interval the next tick beats, 0..1, so that the hands do not all send at once.

        The fractional parts of the multiples of the golden ratio leave no large gap, however many there are.
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

    def _ring(self) -> None:
        """Strike whoever is due."""
        heap, now, run = self._heap, self._clock(), _this_run()
        stood_still, self._run = run is not self._run, run
        while heap and heap[0][0] <= now:
            _, number, tick = heap[0]
            tick.strike(now, stood_still=stood_still)
            heapq.heapreplace(heap, (tick.due, number, tick))
        self._arm()

    def _arm(self) -> None:
        """Come back at the next deadline."""
        due = self._heap[0][0]
        if self._timerfd is not None:
            self._timerfd.arm(due)
            return
        if self._handle is not None:
            self._handle.cancel()
        self._handle = self._loop.call_at(due, self._ring)

    def _watched_timerfd(self) -> TimerFd | None:
        """A timerfd that the loop watches; None where there is none, or where it would tell another time."""
        if self._clock is not time.monotonic:
            return None
        with contextlib.suppress(OSError, NotImplementedError):
            timer = TimerFd()
            try:
                self._loop.add_reader(timer.descriptor, self._ring)
            except BaseException:
                timer.close()
                raise
            return timer
        return None

    def _close(self) -> None:
        if self._bells.pop(self._loop, None) is None:
            return  # given back by another thread
        if self._timerfd is not None and not self._loop.is_closed():
            self._loop.remove_reader(self._timerfd.descriptor)
        if self._handle is not None:
            self._handle.cancel()
        self.give_back()

    def give_back(self) -> None:
        """Close the descriptor; the loop does not watch it any more."""
        if self._timerfd is not None:
            self._timerfd.close()


def _this_run() -> object:
    """Something that stands for the present ``run_forever()`` of the loop that runs here.

    Each of them sets hooks for async generators that are bound to the loop anew: another one, another object.
    Both asyncio and uvloop do.
    """
    return sys.get_asyncgen_hooks().firstiter
