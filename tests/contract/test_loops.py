"""A hand belongs to one event loop; a call from anywhere else sends nothing."""

from __future__ import annotations

import asyncio
import gc
import sys
from collections.abc import Coroutine, Iterator
from concurrent.futures import ThreadPoolExecutor
from typing import Any

import pytest

from robotiq_async import NotStartedError, RobotiqStatus, State, Stream
from robotiq_async.hands import Hand
from tests.calls import CALLS, called
from tests.contract.bench import LOCAL, REMOTE, A, Bench, bench, contract
from tests.virtual import VirtualLoop


def elsewhere(*works: Coroutine[Any, Any, object]) -> list[BaseException | object]:
    """The exceptions, or results, of coroutines in the event loop of another thread."""

    async def all_of_them() -> list[BaseException | object]:
        return await asyncio.gather(*works, return_exceptions=True)

    with ThreadPoolExecutor() as threads:
        return threads.submit(asyncio.run, all_of_them()).result()


@contract
async def test_another_loop(here: Bench, hand: Hand) -> None:
    writes = here.writes
    errors = elsewhere(*(called(hand, name) for name in CALLS))
    for name, error in zip(CALLS, errors, strict=True):
        assert isinstance(error, RuntimeError), name
        assert "outside of the event loop" in str(error), name
    await asyncio.sleep(0.1)
    assert here.writes == writes
    assert hand.state is State.RUNNING_IDLE
    await hand.move(30, A)


@contract
async def test_starting_it_in_another_loop_is_refused_while_it_runs(here: Bench, hand: Hand) -> None:
    assert isinstance(elsewhere(hand.start())[0], Exception)
    assert hand.state is State.RUNNING_IDLE
    await hand.move(30, A)


@contract
async def test_reading_from_another_thread(here: Bench, hand: Hand) -> None:
    def read() -> tuple[object, ...]:
        assert hand.status.sequence >= 0
        assert hand.statistics.polls > 0
        return hand.state, hand.is_moving, hand.is_activated, hand.is_reset

    with ThreadPoolExecutor() as threads:
        assert threads.submit(read).result() == (State.RUNNING_IDLE, False, True, False)


@pytest.fixture
def nothing_kept() -> Iterator[None]:
    """Collect what was left open in a closed loop: Python warns of it then."""
    yield
    gc.collect()


@pytest.mark.skipif(
    (3, 12) <= sys.version_info < (3, 14),
    reason="the tasks that it leaves outlive it, and fail the next test",
)
@pytest.mark.filterwarnings("ignore:unclosed:ResourceWarning")
@pytest.mark.filterwarnings("ignore::pytest.PytestUnraisableExceptionWarning")
@pytest.mark.usefixtures("nothing_kept")
@pytest.mark.parametrize("where", [LOCAL, REMOTE])
def test_a_loop_that_was_closed_under_it(where: str) -> None:
    loop = VirtualLoop()
    context = bench(where)

    async def begin() -> tuple[Bench, Hand, Stream[RobotiqStatus]]:
        here = await context.__aenter__()
        hand = here.make()
        await hand.start()
        return here, hand, hand.statuses()

    _, hand, stream = loop.run_until_complete(begin())
    loop.close()
    with pytest.raises(NotStartedError, match="closed"):
        hand.command(position=3)

    async def go_on() -> None:
        async with asyncio.timeout(3):
            for call in (hand.start, hand.stop, stream.__anext__):
                with pytest.raises(RuntimeError, match=r"closed before stop\(\)"):
                    await call()

    asyncio.run(go_on())
