"""From the thread of ROS's executor into the event loop, and back."""

from __future__ import annotations

import asyncio
import concurrent.futures
from collections.abc import Coroutine
from typing import Any, TypeVar

from rclpy.executors import Executor
from rclpy.task import Future

T = TypeVar("T")


class ClosedError(Exception):
    """The node ends: nothing is asked of the loop any more."""


class Bridge:
    """Three ways across. None blocks the loop, and only :meth:`wait` blocks the executor.

    What is asked of the loop begins in the order in which it was asked.
    """

    def __init__(self, loop: asyncio.AbstractEventLoop, executor: Executor) -> None:
        self._loop = loop
        self._executor = executor
        self._is_closed = False
        self._under_way: set[concurrent.futures.Future[Any]] = set()

    def close(self) -> None:
        """Let nothing more across; what is under way ends as it does."""
        self._is_closed = True

    async def drained(self, timeout: float) -> None:
        """Wait, in the loop, until it has done what it was asked, or the time is over.

        Args:
            timeout: seconds.
        """
        under_way = [asyncio.wrap_future(each) for each in self._under_way]
        if under_way:
            await asyncio.wait(under_way, timeout=timeout)
            await asyncio.gather(*(each for each in under_way if each.done()), return_exceptions=True)

    async def ask(self, work: Coroutine[Any, Any, T]) -> T:
        """Have the loop do something, from a callback of ROS; other callbacks run meanwhile.

        Raises:
            ClosedError: the node ends.
            Exception: what the work raised.
        """
        # An asyncio future would kill the executor. One of ROS's wakes it only through a callback.
        answer = Future(executor=self._executor)
        answer.add_done_callback(lambda _: None)
        self._begin(work).add_done_callback(lambda done: _hand_over(done, answer))
        result: T = await answer
        return result

    def tell(self, work: Coroutine[Any, Any, object]) -> None:
        """Have the loop do something that nobody waits for, and that does not fail.

        Raises:
            ClosedError: the node ends.
        """
        self._begin(work)

    def wait(self, work: Coroutine[Any, Any, T]) -> T:
        """The same, blocking the executor: for transitions, whose callbacks must be synchronous.

        Raises:
            ClosedError: the node ends.
            Exception: what the work raised.
        """
        return self._begin(work).result()

    def _begin(self, work: Coroutine[Any, Any, T]) -> concurrent.futures.Future[T]:
        if self._is_closed:
            work.close()
            raise ClosedError("the node is shutting down")
        future = asyncio.run_coroutine_threadsafe(work, self._loop)
        self._under_way.add(future)
        future.add_done_callback(self._under_way.discard)
        return future


def _hand_over(done: concurrent.futures.Future[Any], answer: Future) -> None:
    if done.cancelled():
        answer.set_exception(ClosedError("the node is shutting down"))
        return
    error = done.exception()
    if error is None:
        answer.set_result(done.result())
    else:
        answer.set_exception(error)
