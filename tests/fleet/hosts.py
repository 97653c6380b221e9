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
        self.outer = outer
        self.due: deque[asyncio.Handle] = deque()
        """Callbacks that became due while the gate was shut."""
        self._transports: list[MemoryTransport] = []

    # -- what is done to it ----------------------------------------------------------------------------

    def freeze(self) -> None:
        """SIGSTOP, or a callback that blocks."""
        self.is_frozen = True

    def thaw(self) -> None:
        """SIGCONT."""
        self.is_frozen = False
        # In one go, with no turn of another task in between: they are all due.
        for _ in range(len(self.due)):
            self.due.popleft()._run()

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

    # -- the loop for programs -------------------------------------------------------------------------

    def time(self) -> float:
        return self.outer.time() - self.slept

    def call_soon(  # type: ignore[override]
        self, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.Handle:
        entry = _Entry(callback, args, self, context)
        self.outer.add(entry)
        return entry

    def call_now(self, callback: Callable[..., object], *args: Any) -> None:
        """Call from outside: at once, or when the gate opens."""
        _Entry(callback, args, self)._run()

    call_soon_threadsafe = call_soon  # type: ignore[assignment]

    def call_at(  # type: ignore[override]
        self, when: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        timer = _Timer(when + self.slept, callback, args, self, context)
        self.outer.add_timer(timer)
        return timer

    def call_later(  # type: ignore[override]
        self, delay: float, callback: Callable[..., object], *args: Any, context: Context | None = None
    ) -> asyncio.TimerHandle:
        return self.call_at(self.time() + delay, callback, *args, context=context)

    def _timer_handle_cancelled(self, handle: asyncio.TimerHandle) -> None:
        self.outer._timer_handle_cancelled(handle)  # type: ignore[attr-defined]

    def create_future(self) -> asyncio.Future[Any]:
        return asyncio.Future(loop=self)

    def create_task(self, coro: Any, **options: Any) -> asyncio.Task[Any]:
        return asyncio.Task(coro, loop=self, **options)

    async def create_connection(self, factory: Any, _host: Any = None, port: Any = None, **_: Any) -> Any:  # type: ignore[override]
        await asyncio.sleep(2 * LATENCY_S)
        if self.is_dead:
            raise ConnectionRefusedError(111, "this host is dead")
        protocol = factory()
        asyncio._set_running_loop(self.outer)
        try:
            transport = self.outer.connect(lambda: _Gate(self, protocol), port)
        finally:
            asyncio._set_running_loop(self)
        self._transports.append(transport)
        protocol.connection_made(transport)
        return transport, protocol

    def call_exception_handler(self, context: Any) -> None:
        self.outer.call_exception_handler(context)

    def get_debug(self) -> bool:
        return False

    def is_running(self) -> bool:
        return True

    def is_closed(self) -> bool:
        return False


class _Entry(asyncio.Handle):
    """A callback of a host, among those of the virtual loop: it runs when the gate is open."""

    __slots__ = ()
    _loop: Host

    def _run(self) -> None:
        host = self._loop
        if host.is_frozen:
            host.due.append(self)
        elif not self._cancelled:
            asyncio._set_running_loop(host)
            try:
                super()._run()
            finally:
                asyncio._set_running_loop(host.outer)


class _Timer(asyncio.TimerHandle, _Entry):
    """The same at its time, which is the virtual loop's."""

    __slots__ = ("_slept",)
    _when: float

    def __init__(
        self, when: float, callback: Callable[..., object], args: Any, host: Host, context: Context | None
    ) -> None:
        super().__init__(when, callback, args, host, context)
        self._slept = host.slept

    def _run(self) -> None:
        host = self._loop
        slept = host.slept - self._slept
        if slept and not host.is_frozen and self._when + slept > host.outer.time() + EARLY_S:
            # By its clock it is not due yet.
            self._when += slept
            self._slept = host.slept
            host.outer.add_timer(self)
        else:
            super()._run()


class _Gate:
    """Stands between a connection and who uses it on a host."""

    def __init__(self, host: Host, protocol: Any) -> None:
        self._host, self._protocol = host, protocol

    def connection_made(self, transport: Any) -> None:
        pass  # the host's own part has the error

    def data_received(self, data: bytes) -> None:
        self._host.call_now(self._protocol.data_received, data)

    def eof_received(self) -> None:
        self._host.call_soon(self._protocol.eof_received)

    def connection_lost(self, why: Exception | None) -> None:
        self._host.call_soon(self._protocol.connection_lost, why)
