"""The beat of the polling: deadlines that are kept, missed ones that are skipped, and what it beats by."""

from __future__ import annotations

import asyncio
import math
import os
import sys
import threading
from collections.abc import Callable, Coroutine, Iterator
from contextlib import ExitStack, contextmanager
from itertools import pairwise
from typing import Any

import pytest

from robotiq_async.runtime.tick import Tick
from tests.virtual import VirtualLoop, virtual

INTERVAL = 0.005
LINUX = sys.platform == "linux"


def open_files() -> int:
    return len(os.listdir("/proc/self/fd"))


class DeafLoop(asyncio.SelectorEventLoop):
    """Watches no descriptors but its own."""

    why: type[Exception] = NotImplementedError

    def add_reader(self, *_: Any) -> Any:  # type: ignore[override]
        raise self.why("no readers")


class FullLoop(DeafLoop):
    why = OSError


def in_loop(main: Callable[[], Coroutine[Any, Any, None]], factory: Any = asyncio.new_event_loop) -> None:
    with asyncio.Runner(loop_factory=factory) as runner:
        runner.run(main())


def loop_of_this_test() -> VirtualLoop:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    return loop


@contextmanager
def ticking() -> Iterator[Tick]:
    """A tick that has begun."""
    tick = Tick(INTERVAL)
    tick.start()
    yield tick
    tick.close()


async def deadlines(tick: Tick, count: int) -> list[float]:
    """The times of so many ticks."""
    times = []
    for _ in range(count):
        await tick.wait()
        times.append(tick.time())
    return times


# -- in virtual time ---------------------------------------------------------------------------------------


@virtual
async def test_the_deadlines_are_absolute() -> None:
    with ticking() as tick:
        times = []
        for _ in range(200):
            times += await deadlines(tick, 1)
            await asyncio.sleep(0.003)  # what is done in between does not shift the next
        assert times[-1] - times[0] == pytest.approx(199 * INTERVAL, abs=1e-6)


@virtual
async def test_the_first_comes_within_an_interval() -> None:
    with ticking() as tick:
        for _ in range(10):
            began = tick.time()
            tick.start()
            assert await tick.wait() == 1
            assert 0 <= tick.time() - began <= INTERVAL + 1e-6
            await asyncio.sleep(0.0123)


@virtual
async def test_missed_ticks_are_counted_and_not_caught_up_with() -> None:
    with ticking() as tick:
        await tick.wait()
        await asyncio.sleep(4.5 * INTERVAL)
        assert await tick.wait() == 4
        assert await tick.wait() == 1


@virtual
async def test_a_slow_reader_is_not_late_and_a_loop_that_is_held_up_is() -> None:
    with ticking() as tick:
        await tick.wait()
        await asyncio.sleep(0.2)
        await tick.wait()
        assert tick.late < 0.001
        loop_of_this_test().hold_up(0.2)
        assert await tick.wait() == 40
        assert tick.late == pytest.approx(0.2, abs=INTERVAL)
        held_up_at = tick.held_up_at
        assert held_up_at == pytest.approx(tick.time(), abs=INTERVAL)
        await tick.wait()
        assert tick.held_up_at == held_up_at
        assert tick.late < 0.001
        assert tick.longest_late == pytest.approx(0.2, abs=INTERVAL)


@virtual
async def test_a_delay_is_noticed_while_no_reader_waits() -> None:
    with ticking() as tick:
        loop_of_this_test().hold_up(0.1)
        assert tick.held_up_at == -math.inf
        await asyncio.sleep(0.001)
        assert tick.held_up_at == pytest.approx(tick.time(), abs=0.002)
        await tick.wait()
        assert tick.late == pytest.approx(0.1, abs=INTERVAL)


@virtual
@pytest.mark.parametrize("hands", [2, 64])
async def test_the_hands_of_a_loop_are_spread_over_the_interval(hands: int) -> None:
    with ExitStack() as stack:
        ticks = [stack.enter_context(ticking()) for _ in range(hands)]
        await asyncio.sleep(INTERVAL)
        times = sorted(tick.due % INTERVAL for tick in ticks)
        gaps = [later - earlier for earlier, later in pairwise([*times, times[0] + INTERVAL])]
        assert min(gaps) > 0.3 * INTERVAL / hands
        assert max(gaps) < 3 * INTERVAL / hands


@virtual
async def test_each_hand_keeps_its_own_interval() -> None:
    fast, slow = Tick(0.002), Tick(0.1)
    fast.start()
    slow.start()
    fast_times, slow_times = await asyncio.gather(deadlines(fast, 500), deadlines(slow, 10))
    assert [b - a for a, b in pairwise(fast_times)] == pytest.approx([0.002] * 499, abs=1e-6)
    assert [b - a for a, b in pairwise(slow_times)] == pytest.approx([0.1] * 9, abs=1e-6)
    fast.close()
    slow.close()


@virtual
async def test_a_loop_with_a_clock_of_its_own_is_woken_by_that_clock() -> None:
    assert Tick(INTERVAL).source == ""
    with ticking() as tick:
        assert tick.source == "loop timer"
        tick.close()
        assert tick.source == ""


@virtual
async def test_a_tick_that_is_closed_does_not_stop_the_others() -> None:
    with ticking() as first, ticking() as second:
        first.close()
        assert len(await deadlines(second, 3)) == 3
        first.start()
        second.close()
        assert len(await deadlines(first, 3)) == 3


# -- in real time ------------------------------------------------------------------------------------------


@pytest.mark.skipif(not LINUX, reason="timerfd is Linux's")
@pytest.mark.parametrize("kind", ["asyncio", "uvloop"])
def test_linux_keeps_the_deadlines(kind: str) -> None:
    async def main() -> None:
        before = open_files()
        tick = Tick(INTERVAL)
        tick.start()
        assert tick.source == "timerfd"
        await tick.wait()
        first, passed = tick.due, 0
        while passed < 20:
            passed += await tick.wait()
            assert tick.time() >= tick.due - tick.interval
        assert tick.due - first == pytest.approx(passed * INTERVAL, abs=1e-6)
        tick.close()
        assert open_files() == before

    in_loop(main, pytest.importorskip(kind).new_event_loop)


@pytest.mark.skipif(not LINUX, reason="timerfd is Linux's")
@pytest.mark.parametrize("loop", [DeafLoop, FullLoop])
def test_where_no_timerfd_is_to_be_had_the_loop_keeps_them(loop: type[DeafLoop]) -> None:
    async def main() -> None:
        before = open_files()
        tick = Tick(INTERVAL)
        tick.start()
        assert tick.source == "loop timer"
        assert open_files() == before
        times = await deadlines(tick, 5)
        assert times == sorted(times)
        tick.close()

    in_loop(main, loop)


class Meanwhile(asyncio.SelectorEventLoop):
    """Lets another thread do something when is_closed() is called."""

    meanwhile: Callable[[], None] | None = None

    def is_closed(self) -> bool:
        meanwhile, self.meanwhile = self.meanwhile, None
        if meanwhile is not None:
            other = threading.Thread(target=meanwhile)
            other.start()
            other.join()
        return super().is_closed()


async def begun() -> Tick:
    tick = Tick(INTERVAL)
    tick.start()
    await tick.wait()
    return tick


@pytest.mark.parametrize("what", ["comes", "goes"])
def test_a_loop_comes_while_others_of_other_threads_come_and_go(what: str) -> None:
    """In a real program that takes luck, or sys.setswitchinterval(1e-6)."""
    asked, going, coming, late = Meanwhile(), *(asyncio.new_event_loop() for _ in range(3))
    ticks = [loop.run_until_complete(begun()) for loop in (asked, going)]

    def come() -> None:
        ticks.append(coming.run_until_complete(begun()))

    asked.meanwhile = come if what == "comes" else ticks[1].close
    ticks.append(late.run_until_complete(begun()))
    assert asked.meanwhile is None
    for tick in ticks:
        tick.close()
    for loop in (asked, going, coming, late):
        loop.close()


@pytest.mark.skipif(not LINUX, reason="timerfd is Linux's")
def test_ticks_of_a_closed_loop_release_the_shared_timer() -> None:
    def abandon() -> Tick:
        loop = asyncio.new_event_loop()
        tick = loop.run_until_complete(begun())
        loop.close()
        return tick

    abandoned = [abandon() for _ in range(2)]
    before = open_files()
    abandoned += [abandon() for _ in range(5)]
    assert open_files() <= before
    for tick in abandoned:
        tick.close()
