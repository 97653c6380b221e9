"""Limits of time that count only while the event loop runs."""

from __future__ import annotations

import asyncio
import math

import anyio
import pytest

from robotiq_async.runtime.limit import LIMIT_GRACE_S, SLICE_S, Limit
from tests.virtual import VirtualLoop

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize(
    ("seconds", "blocks", "expected"),
    [
        (1.4, [], 1.4),
        (0.01, [], 0.01),
        (1.4, [(0.3, 1.5)], 2.8),
        (1.4, [(1.35, 7.0)], 8.35 + LIMIT_GRACE_S),
        (0.05, [(0.01, 2.0)], 2.01 + LIMIT_GRACE_S),
        (1.4, [(0.3, SLICE_S / 2)], 1.4),
        # Held up again and again: a grace is given once.
        (1.0, [(each * 0.2, 0.2) for each in range(100)], 2.4),
    ],
)
async def test_blocks_are_not_counted(
    seconds: float, blocks: list[tuple[float, float]], expected: float
) -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    began = loop.time()
    for at, block in blocks:
        loop.call_later(at, loop.hold_up, block)
    with Limit(seconds) as limit:
        await asyncio.sleep(100)
    assert limit.is_over
    assert loop.time() - began == pytest.approx(expected, abs=0.02)


async def test_a_block_between_the_making_and_the_entering_is_not_counted() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    limit = Limit(1.4)
    loop.hold_up(5.0)
    began = loop.time()
    with limit:
        await asyncio.sleep(100)
    assert loop.time() - began > 1.2


async def test_what_is_left_does_not_count_a_block_that_is_just_over() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    limit = Limit(1.0)
    await asyncio.sleep(0.55)
    loop.hold_up(5.0)
    assert limit.left == pytest.approx(0.45, abs=SLICE_S)
    loop.hold_up(5.0)
    assert limit.left == pytest.approx(0.45, abs=2 * SLICE_S)
    assert Limit().left == math.inf
    limit.stop()


async def test_a_shielded_block_ends_with_the_limit_however_its_task_is_cancelled() -> None:
    loop = asyncio.get_running_loop()
    began, ended = loop.time(), list[float]()

    async def work() -> None:
        with Limit(1.0, shield=True):
            await asyncio.sleep(100)
        ended.append(loop.time() - began)
        await asyncio.sleep(100)

    async with anyio.create_task_group() as group:
        group.start_soon(work)
        await asyncio.sleep(0.1)
        group.cancel_scope.cancel()
    assert ended == [pytest.approx(1.0)]


async def test_a_block_that_was_left_has_no_more_looks_at_the_clock() -> None:
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    with Limit(1000.0):
        await asyncio.sleep(1.0)
    before = loop.turns
    await asyncio.sleep(900.0)
    assert loop.turns - before < 5


async def test_it_may_be_restarted_and_entered_again() -> None:
    loop = asyncio.get_running_loop()
    limit = Limit()
    with limit:
        await asyncio.sleep(1000)
    assert not limit.is_over
    limit.restart(0.5)
    began = loop.time()
    with limit:
        await asyncio.sleep(1000)
    assert limit.is_over
    assert loop.time() - began == pytest.approx(0.5)
