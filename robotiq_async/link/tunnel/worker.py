"""Calls of foreign coroutines, made in a separate task so that they cannot block the caller."""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable
from typing import Any, Final, TypeVar

from ...runtime.concurrency import LateError
from ...runtime.limit import Limit

T = TypeVar("T")


class Worker:
    """Makes calls one after the other, all of them in one task.

    The caller waits for a limited time. A late call is cancelled and its result dropped. A call that survives
    its cancellation delays the next ones: two calls never run at once.

    Args:
        name: of the task, which starts with the first call.
    """

    def __init__(self, name: str) -> None:
        self._name = name
        self._task: asyncio.Task[None] | None = None
        self._calls: _Calls

    async def call(self, work: Callable[[], Awaitable[T]], seconds: float) -> T:
        """Make a call and wait for its result; ``work`` may raise before it returns an awaitable.

        Raises:
            LateError: the time limit expired.
            Exception: raised by the call; a CancelledError that it raises becomes a RuntimeError.
        """
        loop = asyncio.get_running_loop()
        ended = loop.create_future()
        call = self._put(work, lambda: ended.set_result(None))
        try:
            with Limit(seconds):
                await asyncio.wait({ended})
        finally:
            call.give_up()
        if not ended.done():
            why = "" if call.task else ": the previous call ignored its cancellation"
            raise LateError(f"within {seconds:g} s{why}")
        if call.error is None:
            result: T = call.result
            return result
        if isinstance(call.error, Exception):
            raise call.error
        raise RuntimeError(f"it ended with {call.error!r}") from call.error

    def begin(self, work: Callable[[], Awaitable[Any]], on_end: Callable[[], None]) -> TunnelCall:
        """Begin a call, after those before it; ``on_end`` is called as soon as it has ended."""
        return self._put(work, on_end)

    def end(self, work: Callable[[], Awaitable[None]]) -> None:
        """Make a last call, which must limit its own time and not fail, then end the task. Does not wait."""
        self._put(work, lambda: None, is_last=True)

    async def ended(self, seconds: float) -> bool:
        """Wait for the end of the task; returns whether it has ended."""
        if self._task is not None:
            await asyncio.wait({self._task}, timeout=seconds)
        return self._task is None or self._task.done()

    def _put(
        self, work: Callable[[], Awaitable[Any]], on_end: Callable[[], None], *, is_last: bool = False
    ) -> TunnelCall:
        loop = asyncio.get_running_loop()
        call = TunnelCall(work, on_end, is_last)
        if self._task is None or self._task.done() or self._task.get_loop() is not loop:
            self._calls = _Calls()
            self._start(loop)
        self._calls.put(call)
        return call

    def _start(self, loop: asyncio.AbstractEventLoop) -> None:
        self._task = loop.create_task(_work(self._calls), name=self._name)
        self._task.add_done_callback(self._on_end)

    def _on_end(self, task: asyncio.Task[None]) -> None:
        """Start again if calls remain: asyncio.run() cancels all tasks at its end."""
        if task is self._task and self._calls.waiting:
            self._start(task.get_loop())


async def _work(calls: _Calls) -> None:
    """Make the calls, until the last one."""
    while calls.waiting or not calls.has_ended:
        call = await calls.get()
        if not call.is_given_up:
            calls.begin(call)
            await call.make()


class _Calls:
    """The queue of calls. ``asyncio.Queue`` raises when its loop is closed while a task waits for an item."""

    def __init__(self) -> None:
        self.waiting: deque[TunnelCall] = deque()
        self.has_ended = False  # whether the call that was started last is the last one
        self._more = asyncio.Event()

    def begin(self, call: TunnelCall) -> None:
        """It is started now."""
        self.has_ended = call.is_last

    def put(self, call: TunnelCall) -> None:
        self.waiting.append(call)
        self._more.set()

    async def get(self) -> TunnelCall:
        while not self.waiting:
            self._more.clear()
            await self._more.wait()
        return self.waiting.popleft()


class TunnelCall:
    """One call and its outcome.

    Attributes:
        task: the task that runs the call, as long as it runs.
        result: the value that it returned.
        error: the exception that it raised.
    """

    def __init__(self, work: Callable[[], Awaitable[Any]], on_end: Callable[[], None], is_last: bool) -> None:
        self._work: Final = work
        self._on_end: Final = on_end
        self.is_last: Final = is_last
        self.is_given_up: bool = False
        self.task: asyncio.Task[Any] | None = None
        self.result: Any = None
        self.error: BaseException | None = None

    async def make(self) -> None:
        """Run the call; raises only an exception that ends the task."""
        self.task = task = asyncio.current_task()
        assert task is not None
        try:
            self.result = await self._work()
        except BaseException as error:
            self.error = error
            if not (isinstance(error, Exception) or self.is_given_up):
                raise
        finally:
            self.task = None
            if not task.get_loop().is_closed():
                self._on_end()
        while self.is_given_up and task.cancelling():
            task.uncancel()

    def give_up(self) -> None:
        """Cancel the call if it has not ended."""
        self.is_given_up = True
        if self.task is not None:
            self.task.cancel()
