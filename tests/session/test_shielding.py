"""Work that ends well, whatever happens to those who wait for it."""

from __future__ import annotations

import asyncio
import threading

import anyio
import pytest

from robotiq_async.runtime.concurrency import in_a_thread, wait_shielded


async def test_a_cancellation_waits_for_the_end() -> None:
    work: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    waiting = asyncio.create_task(wait_shielded(work))
    for _ in range(3):
        await asyncio.sleep(0)
        waiting.cancel()
    await asyncio.sleep(0)
    assert not waiting.done()
    work.set_result(3)
    with pytest.raises(asyncio.CancelledError):
        await waiting
    assert not work.cancelled()


async def test_a_scope_that_is_cancelled_waits_too() -> None:
    work: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    asyncio.get_running_loop().call_later(0.05, work.set_result, 3)
    with anyio.CancelScope() as scope:
        scope.cancel()
        await wait_shielded(work)
        assert work.done()
        await asyncio.sleep(0)
        raise AssertionError("the scope is cancelled")


async def test_what_the_work_raises_stays_with_it() -> None:
    work: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    work.set_exception(ZeroDivisionError())
    await wait_shielded(work)
    assert isinstance(work.exception(), ZeroDivisionError)


async def test_a_thread_gives_its_result_or_its_error() -> None:
    assert await in_a_thread(threading.get_ident) != threading.get_ident()
    with pytest.raises(ValueError, match="invalid literal"):
        await in_a_thread(lambda: int("x"))


async def test_nobody_waits_for_a_thread_that_is_stuck() -> None:
    stuck = threading.Event()
    work = in_a_thread(stuck.wait)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await work
    stuck.set()
    assert all(thread.daemon for thread in threading.enumerate() if thread.name == "robotiq_async")
