"""Work that ends well whatever happens to its callers, and which hosts are this machine."""

from __future__ import annotations

import asyncio
import threading

import anyio
import pytest

from robotiq_async.runtime.concurrency import in_a_thread, wait_shielded
from robotiq_async.runtime.sockets import is_loopback


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


async def test_an_error_of_the_work_stays_with_it() -> None:
    work: asyncio.Future[int] = asyncio.get_running_loop().create_future()
    work.set_exception(ZeroDivisionError())
    await wait_shielded(work)
    assert isinstance(work.exception(), ZeroDivisionError)


async def test_a_thread_gives_its_result_or_its_error() -> None:
    assert await in_a_thread(threading.get_ident) != threading.get_ident()
    with pytest.raises(ValueError, match="invalid literal"):
        await in_a_thread(lambda: int("x"))


async def test_a_thread_that_cannot_be_started_is_an_error_of_the_system(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    def refused(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    monkeypatch.setattr(threading.Thread, "start", refused)
    with pytest.raises(OSError, match="can't start new thread"):
        await in_a_thread(list)


async def test_a_stuck_thread_is_not_waited_for() -> None:
    stuck = threading.Event()
    work = in_a_thread(stuck.wait)
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.01):
            await work
    stuck.set()
    assert all(thread.daemon for thread in threading.enumerate() if thread.name == "robotiq_async")


@pytest.mark.parametrize("host", ["127.0.0.1", "127.1.2.3", "::1", "localhost", "LOCALHOST"])
def test_a_host_of_this_machine(host: str) -> None:
    assert is_loopback(host)


@pytest.mark.parametrize("host", ["127.evil.example", "localhost.example.com", "::1234", "0.0.0.0"])
def test_a_host_that_others_may_reach(host: str) -> None:
    assert not is_loopback(host)
