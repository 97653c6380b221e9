"""Hosts in one virtual loop: programs on one can be frozen or killed while the others run on.

A host is an event loop of its own that lives inside the virtual one: its callbacks, tasks, timers and
connections are called through a gate. While the gate is shut nothing of the host runs, and when it opens
again everything that had become due runs at once, as in a process after SIGCONT.
"""

from __future__ import annotations

import asyncio
from collections import deque
from collections.abc import Callable, Coroutine
from contextvars import Context
from typing import TYPE_CHECKING, Any, TypeVar

from tests.virtual import LATENCY_S, MemoryTransport, VirtualLoop

T = TypeVar("T")
EARLY_S = 1e-6

if TYPE_CHECKING:
    _Loop = asyncio.SelectorEventLoop  # of which only a part is here, and needed
else:
    _Loop = asyncio.AbstractEventLoop


class Host(_Loop):
    """One host's event loop."""

    def __init__(self, name: str) -> None:
        outer = asyncio.get_running_loop()
        assert isinstance(outer, VirtualLoop)
        self.name = name
        self.is_frozen = False
        self.is_dead = False
        self.slept = 0.0
        """Seconds for which its clock has stood still."""
        self._outer = outer
        self._due: deque[asyncio.Handle] = deque()
        self._transports: list[MemoryTransport] = []

    # -- what is done to it ----------------------------------------------------------------------------

    def freeze(self) -> None:
        """SIGSTOP, or a callback that blocks."""
        self.is_frozen = True

    def thaw(self) -> None:
        """SIGCONT."""
        self.is_frozen = False
        # In one go, with no turn of another task in between: they are all due.
        for _ in range(len(self._due)):
            self._run(self._due.popleft())

    def wake(self, seconds: float) -> None:
        """It was suspended for so long and not only frozen: its clock knows nothing of that time."""
        self.slept += seconds
        self.thaw()

    def kill(self) -> None:
        """SIGKILL: nothing of it runs, and its connections are closed."""
        self.freeze()
        self.is_dead = True
        for transport in self._transports:
            transport.close()

    async def bury(self) -> None:
        """Let what was killed, or is left, come to its end unheard."""
        self.is_dead = True
        self.thaw()
        left = asyncio.all_tasks(self)
        for task in left:
            task.cancel()
        while not all(task.done() for task in left):  # noqa: ASYNC110  # tasks of another loop
            await asyncio.sleep(0.01)

    async def do(self, work: Coroutine[Any, Any, T]) -> T:
        """Run something on it, from outside, and wait for it."""
        task: asyncio.Task[T] = self.create_task(work)
        done = asyncio.Event()
        task.add_done_callback(lambda _: done.set())
        try:
            await done.wait()
        except asyncio.CancelledError:
            task.cancel()
            raise
        return task.result()

    # -- the gate --------------------------------------------------------------------------------------

    def _run(self, handle: asyncio.Handle) -> None:
        if self.is_frozen:
            self._due.append(handle)
        elif isinstance(handle, asyncio.TimerHandle) and handle.when() > self.time() + EARLY_S:
            # By its clock it is not due yet.
            self._outer.call_at(handle.when() + self.slept, self._run, handle)
        elif not handle.cancelled():
            before = asyncio._get_running_loop()
            asyncio._set_running_loop(self)
            try:
                handle._run()
            finally:
                asyncio._set_running_loop(before)

    # -- the loop for programs -------------------------------------------------------------------------

    def time(self) -> float:
        return self._outer.time() - self.slept

    def call_soon(  # type: ignore[override]
        self, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.Handle:
        handle = asyncio.Handle(callback, args, self, context)
        self._outer.call_soon(self._run, handle)
        return handle

    call_soon_threadsafe = call_soon  # type: ignore[assignment]

    def call_at(  # type: ignore[override]
        self, when: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        handle = asyncio.TimerHandle(when, callback, args, self, context)
        self._outer.call_at(when + self.slept, self._run, handle)
        return handle

    def call_later(  # type: ignore[override]
        self, delay: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        return self.call_at(self.time() + delay, callback, *args, context=context)

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        pass

    def create_future(self) -> asyncio.Future[Any]:
        return asyncio.Future(loop=self)

    def create_task(self, coro: Any, **options: Any) -> asyncio.Task[Any]:
        return asyncio.Task(coro, loop=self, **options)

    async def create_connection(self, factory: Any, _host: Any = None, port: Any = None, **_: Any) -> Any:  # type: ignore[override]
        await asyncio.sleep(2 * LATENCY_S)
        if self.is_dead:
            raise ConnectionRefusedError(111, "this host is dead")
        protocol = factory()
        asyncio._set_running_loop(self._outer)
        try:
            transport = self._outer.connect(lambda: _Gate(self, protocol), port)
        finally:
            asyncio._set_running_loop(self)
        self._transports.append(transport)
        protocol.connection_made(transport)
        return transport, protocol

    def call_exception_handler(self, context: Any) -> None:
        self._outer.call_exception_handler(context)

    def get_debug(self) -> bool:
        return False

    def is_running(self) -> bool:
        return True

    def is_closed(self) -> bool:
        return False


class _Gate:
    """Stands between a connection and who uses it on a host."""

    def __init__(self, host: Host, protocol: Any) -> None:
        self._host, self._protocol = host, protocol

    def connection_made(self, transport: Any) -> None:
        pass  # the host's own part has the error

    def data_received(self, data: bytes) -> None:
        self._host.call_soon(self._protocol.data_received, data)

    def eof_received(self) -> None:
        self._host.call_soon(self._protocol.eof_received)

    def connection_lost(self, why: Exception | None) -> None:
        self._host.call_soon(self._protocol.connection_lost, why)
