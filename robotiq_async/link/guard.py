"""Makes a transport object of an application keep the promises that a hand relies on.

The calls of its foreign coroutines are made in a task of their own so that they cannot block the caller.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from typing import Any, Final, TypeVar

import anyio

from ..runtime.concurrency import LateError
from ..runtime.log import Log, log
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from ..values.registers import Registers, check_registers
from .transport import Transport
from .watchdog import GRACE_S, HELD_S

T = TypeVar("T")


class GuardedTransport:
    """Limits the time of every call, converts foreign exceptions, and closes after a failure."""

    def __init__(
        self, inner: Transport, name: str, *, connect_timeout: float, response_timeout: float, log: Log = log
    ) -> None:
        self._log = log
        self._inner = inner
        self._is_open = False
        self._name = name
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._worker = Worker("robotiq_async transport")
        self._is_begun = False  # whether open() was called without a close() since

    @property
    def is_open(self) -> bool:
        try:
            return self._is_open and bool(self._inner.is_open)
        except Exception as error:  # noqa: BLE001  # treated as not open
            self._log.warning("is_open of the transport raised %r", error)
            return False

    async def open(self) -> None:
        self._drop()
        try:
            await self._bounded(self._open_inner, self._connect_timeout)
        except (ResponseTimeoutError, ConnectionLostError) as error:
            raise ConnectFailedError(self._name, str(error)) from error
        self._is_open = True

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: the call failed, took too long, or did not return eight registers.
        """
        registers = await self._bounded(self._inner.read, self._response_timeout)
        try:
            return check_registers(registers)
        except Exception as error:  # the result may be any iterable
            self._drop()
            raise ProtocolError(f"{self._name}: {error}") from error

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything. The worker's task calls it just before the write.

        Raises:
            RobotiqConnectionError: the call failed or took too long.
        """

        async def write() -> bool:
            registers = decide()
            if registers is None:
                return False
            await self._inner.write(registers)
            return True

        return await self._bounded(write, self._response_timeout)

    async def close(self) -> None:
        self._drop()
        with anyio.CancelScope(shield=True):
            if not await self._worker.ended(self._response_timeout):
                self._log.warning("transport abandoned: its last call did not return")

    def _drop(self) -> None:
        """Close it after its present call. Only the next open() waits for that."""
        # Replies that this connection still delivers must not answer a new request.
        self._is_open = False
        if self._is_begun:
            self._is_begun = False
            self._worker.end(self._close_inner)

    async def _open_inner(self) -> None:
        self._is_begun = True
        await self._inner.open()

    async def _close_inner(self) -> None:
        try:
            async with asyncio.timeout(self._response_timeout):
                await self._inner.close()
        except Exception as error:  # noqa: BLE001  # nothing is left to do
            self._log.warning("the transport did not close: %r", error)

    async def _bounded(self, call: Callable[[], Awaitable[T]], seconds: float) -> T:
        try:
            return await self._worker.call(call, seconds)
        except RobotiqConnectionError:
            self._drop()
            raise
        except LateError as error:
            self._drop()
            raise ResponseTimeoutError(f"{self._name} did not answer {error}") from None
        except Exception as error:
            self._drop()
            raise ConnectionLostError(f"{self._name}: {error!r}") from error
        except asyncio.CancelledError:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._drop()
            raise


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

    async def call(self, what: Callable[[], Awaitable[T]], seconds: float) -> T:
        """Make a call and wait for its result; ``what`` may raise before it returns an awaitable.

        Raises:
            LateError: the time limit expired.
            Exception: raised by the call; a CancelledError of its own becomes a RuntimeError.
        """
        loop = asyncio.get_running_loop()
        call = self._put(what)
        due = loop.time() + seconds
        try:
            await asyncio.wait({call.done}, timeout=seconds)
            if not call.done.done() and loop.time() - due > HELD_S:
                # The loop was blocked: a result that was waiting meanwhile is in time.
                await asyncio.wait({call.done}, timeout=GRACE_S)
        finally:
            call.give_up()
        if not call.done.done():
            why = "" if call.task else ": the call before goes on although it was cancelled"
            raise LateError(f"within {seconds:g} s{why}")
        if call.error is None:
            result: T = call.result
            return result
        if isinstance(call.error, Exception):
            raise call.error
        raise RuntimeError(f"it ended with {call.error!r}") from call.error

    def end(self, what: Callable[[], Awaitable[None]]) -> None:
        """Make a last call, which must limit its own time and not fail, then end the task. Does not wait."""
        self._put(what, is_last=True)

    async def ended(self, seconds: float) -> bool:
        """Wait for the end of the task; returns whether it has ended."""
        if self._task is not None:
            await asyncio.wait({self._task}, timeout=seconds)
        return self._task is None or self._task.done()

    def _put(self, what: Callable[[], Awaitable[Any]], *, is_last: bool = False) -> _Call:
        loop = asyncio.get_running_loop()
        call = _Call(what, loop.create_future(), is_last)
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
            calls.has_ended = call.is_last
            await call.make()


class _Calls:
    """The queue of calls. ``asyncio.Queue`` raises when its loop is closed while a task waits for an item."""

    def __init__(self) -> None:
        self.waiting: deque[_Call] = deque()
        self.has_ended = False  # whether the call that was started last is the last one
        self._more = asyncio.Event()

    def put(self, call: _Call) -> None:
        self.waiting.append(call)
        self._more.set()

    async def get(self) -> _Call:
        while not self.waiting:
            self._more.clear()
            await self._more.wait()
        return self.waiting.popleft()


class _Call:
    """One call and its outcome."""

    def __init__(self, what: Callable[[], Awaitable[Any]], done: asyncio.Future[None], is_last: bool) -> None:
        self._what: Final = what
        self.done: Final = done
        self.is_last: Final = is_last
        self.is_given_up = False
        self.task: asyncio.Task[Any] | None = None  # the task that runs the call, once it has begun
        self.result: Any = None
        self.error: BaseException | None = None

    async def make(self) -> None:
        """Run the call; raises only what ends the task."""
        self.task = task = asyncio.current_task()
        assert task is not None
        try:
            self.result = await self._what()
        except BaseException as error:
            self.error = error
            if not (isinstance(error, Exception) or self.is_given_up):
                raise
        finally:
            if not self.done.get_loop().is_closed():
                self.done.set_result(None)
        while self.is_given_up and task.cancelling():
            task.uncancel()

    def give_up(self) -> None:
        """Cancel the call if it has not ended."""
        if not self.done.done():
            self.is_given_up = True
            if self.task is not None:
                self.task.cancel()
