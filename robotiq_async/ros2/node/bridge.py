"""Bridge: from the thread of ROS's executor into the event loop, and back."""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import Callable, Coroutine
from contextlib import suppress
from typing import Any, Final, TypeVar

from rclpy.executors import Executor
from rclpy.task import Future

T = TypeVar("T")
PASSES: Final = 4
"""Passes of an executor until an answer is sent: a callback ends, its result is set, it is sent; one more."""


class ClosedError(Exception):
    """The node is shutting down: the loop accepts no more work."""


class Bridge:
    """Four ways to run work in the loop. None blocks the loop, and only :meth:`wait` blocks the executor.

    Work begins in the order of the calls.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, executor: Executor) -> None:
        self._loop = loop
        self._executor = executor
        self._is_closed = False
        self._under_way: set[concurrent.futures.Future[Any]] = set()

    def close(self) -> None:
        """Accept no more work; work that has begun ends normally."""
        self._is_closed = True

    async def drained(self, timeout: float) -> None:
        """Wait, in the loop, until work is done and the executor has answered, or for ``timeout`` seconds."""
        with suppress(TimeoutError):
            async with asyncio.timeout(timeout):
                under_way = [asyncio.wrap_future(each) for each in self._under_way]
                await asyncio.gather(*under_way, return_exceptions=True)
                for _ in range(PASSES):
                    await self._executor_pass()

    async def _executor_pass(self) -> None:
        # A pass runs each task once, in an order that differs between distributions, and tasks that begin
        # during a pass run in the next one. When a task has run, the pass before it is therefore complete.
        passed = asyncio.Event()
        self._executor.create_task(self._loop.call_soon_threadsafe, passed.set)
        await passed.wait()

    async def ask(self, work: Coroutine[Any, Any, T]) -> T:
        """Run work in the loop, from a callback of ROS; other callbacks continue to run."""
        # Awaiting an asyncio future would end the executor. A future of ROS wakes it only with a callback.
        answer = Future(executor=self._executor)
        answer.add_done_callback(lambda _: None)
        self._begin(work).add_done_callback(lambda done: _copy_result(done, answer))
        result: T = await answer
        return result

    def submit(self, work: Coroutine[Any, Any, object]) -> None:
        """Run work in the loop without waiting for it. It must not raise."""
        self._begin(work)

    def tell(self, what: Callable[..., object], *arguments: object) -> None:
        """Call a function in the loop, also after :meth:`close`. It must not raise."""
        self._loop.call_soon_threadsafe(what, *arguments)

    def wait(self, work: Coroutine[Any, Any, T]) -> T:
        """Run work in the loop and block the executor: for transitions, whose callbacks are synchronous."""
        return self._begin(work).result()

    def _begin(self, work: Coroutine[Any, Any, T]) -> concurrent.futures.Future[T]:
        if self._is_closed:
            work.close()
            raise ClosedError("the node is shutting down")
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        return future


def _copy_result(done: concurrent.futures.Future[Any], answer: Future) -> None:
    if done.cancelled():
        answer.set_exception(ClosedError("the node is shutting down"))
        return
    error = done.exception()
    if error is None:
        answer.set_result(done.result())
    else:
        answer.set_exception(error)
