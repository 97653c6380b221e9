"""Calls of foreign code: made in order, in one task, with a time limit."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable
from functools import partial

import pytest

from robotiq_async.link.tunnel.worker import Worker
from robotiq_async.runtime.clock import now
from robotiq_async.runtime.concurrency import LateError

pytestmark = pytest.mark.virtual_time


@pytest.fixture
async def worker() -> AsyncIterator[Worker]:
    """A worker: at the end of a test its task ends, and with it whatever waits."""
    worker = Worker("worker")
    yield worker
    worker.end(nothing)
    assert await worker.ended(1.0)


async def nothing() -> None:
    """A call."""


async def stubborn(until: asyncio.Event) -> str:
    """Does not end when it is cancelled."""
    while not until.is_set():
        with contextlib.suppress(asyncio.CancelledError):
            await until.wait()
    return "late"


async def never() -> None:
    await asyncio.Event().wait()


async def test_calls_are_made_in_order_and_in_one_task(worker: Worker) -> None:
    tasks = []

    async def call(number: int) -> int:
        tasks.append(asyncio.current_task())
        await asyncio.sleep(0.01)
        return number

    calls = (worker.call(partial(call, number), 1.0) for number in range(3))
    assert await asyncio.gather(*calls) == [0, 1, 2]
    worker.end(nothing)
    assert await worker.ended(1.0)
    assert len(set(tasks)) == 1


async def test_errors_of_a_call_are_raised(worker: Worker) -> None:
    async def fail() -> None:
        raise KeyError("why")

    def fail_at_once() -> Awaitable[None]:
        raise BrokenPipeError

    async def cancel_itself() -> None:
        raise asyncio.CancelledError

    with pytest.raises(KeyError):
        await worker.call(fail, 1.0)
    with pytest.raises(BrokenPipeError):
        await worker.call(fail_at_once, 1.0)
    with pytest.raises(RuntimeError, match="it ended with"):
        await worker.call(cancel_itself, 1.0)
    with pytest.raises(TypeError):
        await worker.call(lambda: 3, 1.0)  # type: ignore[arg-type,return-value]


async def test_a_late_call_is_cancelled_and_the_next_goes_on_in_its_task(worker: Worker) -> None:
    async def in_time() -> int:
        async with asyncio.timeout(0.5):  # relies on the task not having been cancelled before
            await asyncio.sleep(0.1)
        task = asyncio.current_task()
        assert task is not None
        return task.cancelling()

    began = now()
    with pytest.raises(LateError, match=r"within 0\.1 s$"):
        await worker.call(never, 0.1)
    assert now() - began == pytest.approx(0.1)
    assert await worker.call(in_time, 1.0) == 0


async def test_a_call_that_does_not_end_is_not_waited_for_and_nothing_is_made_meanwhile(
    worker: Worker,
) -> None:
    until, made = asyncio.Event(), []

    async def note(what: str) -> None:
        made.append(what)

    with pytest.raises(LateError):
        await worker.call(lambda: stubborn(until), 0.1)
    with pytest.raises(LateError, match="the previous call ignored its cancellation"):
        await worker.call(lambda: note("given up before it began"), 0.1)
    worker.end(lambda: note("end"))
    assert not await worker.ended(0.1)
    assert made == []
    until.set()
    assert await worker.ended(0.1)
    assert made == ["end"]


async def test_a_cancelled_caller_gives_up_the_call(worker: Worker) -> None:
    waiting = asyncio.create_task(worker.call(never, 10.0))
    await asyncio.sleep(0.1)
    waiting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await waiting


async def test_a_call_after_the_end_begins_anew(worker: Worker) -> None:
    for _ in range(2):
        await worker.call(nothing, 1.0)
        worker.end(nothing)
        assert await worker.ended(1.0)
    assert await worker.ended(0.0)


async def test_a_call_after_a_last_one_that_waits_is_made_after_it(worker: Worker) -> None:
    until = asyncio.Event()
    with pytest.raises(LateError):
        await worker.call(lambda: stubborn(until), 0.1)
    worker.end(nothing)
    again = asyncio.create_task(worker.call(nothing, 1.0))
    await asyncio.sleep(0.1)
    until.set()
    await again
    assert not await worker.ended(0.1)


async def test_the_task_ends_though_the_last_call_ends_it_and_calls_wait_that_were_given_up(
    worker: Worker,
) -> None:
    until = asyncio.Event()

    async def cancel_itself() -> None:
        raise asyncio.CancelledError

    with pytest.raises(LateError):
        await worker.call(lambda: stubborn(until), 0.1)
    worker.end(cancel_itself)
    with pytest.raises(LateError):
        await worker.call(nothing, 0.1)
    until.set()
    await asyncio.sleep(0.1)
    assert await worker.ended(0.1)
