"""An event loop whose time is not real: it jumps ahead when nothing is left to do.

Seconds of polling pass in milliseconds, a timeout takes no time, two runs take the same course, and
a wait for something that will never come is an error at once. Connections made in such a loop, and
its serial ports (tests/virtual_line.py), are made of memory; real descriptors work too, as long as what
is written to one can be read from the other at once.
"""

from __future__ import annotations

import asyncio
import contextlib
import functools
import gc
import heapq
import inspect
import itertools
import math
import os
import selectors
import socket
import threading
import time
from collections import deque
from collections.abc import Callable, Coroutine
from contextlib import AbstractAsyncContextManager, AsyncExitStack
from typing import Any, TypeVar

T = TypeVar("T")

BLUR_S = 0.001
"""Time that others took counts from the last look at it, which is at most so long ago."""
LATENCY_S = 0.0002
"""Seconds that bytes need from one end of a connection to the other."""
LIMIT_S = 500.0
"""Virtual seconds that a test inside a scene may take: what takes longer hangs."""


class NothingWillHappenError(AssertionError):
    """All tasks wait, and nothing is going to happen."""


class HoldWatch:
    """Measures in real time how long callbacks keep the loop.

    Without the time that other processes took, and that the garbage collector took: a full collection of all
    that some thousand tests have left in a process lasts 30 ms, and comes at any moment.
    """

    def __init__(self) -> None:
        self.longest = 0.0
        self._began = 0.0
        self._waited = 0.0
        self._looked = -1.0
        self._collected = 0.0
        self._collection_began = 0.0
        gc.callbacks.append(self._see_collection)
        self._file = -1
        with contextlib.suppress(OSError):
            # CPU time, time spent waiting for a CPU (both ns), and slices: Linux only.
            self._file = os.open(f"/proc/self/task/{threading.get_native_id()}/schedstat", os.O_RDONLY)

    def begin(self) -> None:
        """Count from now on."""
        self._began = 0.0
        self.turn()

    def turn(self) -> None:
        """One turn of the loop has ended, and the next begins."""
        now = time.perf_counter()
        if now - self._began > self.longest and self._began:
            self.longest = max(self.longest, now - self._began - (self.waiting() - self._waited))
            now = time.perf_counter()
        if now - self._looked > BLUR_S:  # a look costs as much as a short callback
            self._waited = self.waiting()
            now = self._looked = time.perf_counter()
        self._began = now

    def close(self) -> None:
        with contextlib.suppress(ValueError):  # closed already
            gc.callbacks.remove(self._see_collection)
        if self._file >= 0:
            os.close(self._file)
            self._file = -1

    def waiting(self) -> float:
        """Seconds for which others ran: other processes while this thread could have, and the collector."""
        waited = int(os.pread(self._file, 100, 0).split()[1]) / 1e9 if self._file >= 0 else 0.0
        return waited + self._collected

    def _see_collection(self, phase: str, _info: object) -> None:
        if phase == "start":
            self._collection_began = time.perf_counter()
        else:
            self._collected += time.perf_counter() - self._collection_began


class VirtualClock(selectors.DefaultSelector):
    """Does not wait: it moves the clock."""

    def __init__(self) -> None:
        super().__init__()
        # Far from the system's clock, however long the machine has run.
        self.now = 1e6
        self.ends = math.inf
        self.turns = 0
        self.at_turn: tuple[int, Callable[[], object]] | None = None
        self.hold: HoldWatch | None = None
        self._watched = self.get_map()

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if self.hold is not None:
            self.hold.turn()
        # Most loops have nothing to look at but the descriptor by which other threads wake the
        # loop: what they want done is among the callbacks already, and only who waits for nothing else looks.
        events = super().select(0) if timeout is None or len(self._watched) > 1 else []
        self.turns += 1
        if self.at_turn is not None and self.turns >= self.at_turn[0]:
            call, self.at_turn = self.at_turn[1], None
            call()
            return events
        if not events and timeout is None:
            raise NothingWillHappenError("all tasks wait, and nothing is going to happen")
        if not events and timeout:
            self.now += timeout
            if self.now > self.ends:
                self.ends = math.inf
                raise NothingWillHappenError("this takes too long")
        return events

    def close(self) -> None:
        super().close()
        if self.hold is not None:
            self.hold.close()


_PORTS = itertools.cycle(range(20001, 60000))
"""A gripper of one test is none of the next: the session remembers what a hand has left on its way."""


class VirtualLoop(asyncio.SelectorEventLoop):
    """The loop; :meth:`time` is virtual, and connections stay inside."""

    def __init__(self, clock: VirtualClock | None = None) -> None:
        self._virtual = clock or VirtualClock()
        super().__init__(self._virtual)
        self._listeners: dict[int, _Listener] = {}
        self._files: dict[int, MemoryFile] = {}
        self.complaints: list[str] = []
        self.set_exception_handler(lambda _, context: self.complaints.append(repr(context)))

    def time(self) -> float:
        return self._virtual.now

    def watch_holds(self) -> None:
        """Measure from here on for how long callbacks keep the loop, which takes a while in every turn."""
        self._virtual.hold = HoldWatch()

    @property
    def longest_hold(self) -> float:
        """The longest time, in real seconds, that callbacks have kept the loop since :meth:`watch_holds`."""
        assert self._virtual.hold is not None, "holds are not watched"
        return self._virtual.hold.longest

    @property
    def turns(self) -> int:
        """The number of times that the loop has looked for work."""
        return self._virtual.turns

    def end_after(self, seconds: float) -> None:
        """Let what takes longer fail.

        Not by a timer, which would change the order of others that are due at the same instant.
        """
        self._virtual.ends = self.time() + seconds

    def after_turns(self, count: int, call: Callable[[], object]) -> None:
        """Call something after so many more turns of the loop: between any two callbacks, if need be."""
        self._virtual.at_turn = (self._virtual.turns + count, call)

    def hold_up(self, seconds: float) -> None:
        """Let time pass in which nothing else can happen in this loop, as a blocking call does."""
        self._virtual.now += seconds

    def add(self, handle: asyncio.Handle) -> None:
        """Let a handle run in its turn, as it is."""
        self._ready.append(handle)  # type: ignore[attr-defined]

    def add_timer(self, timer: asyncio.TimerHandle) -> None:
        """Let a timer run at its time, as it is."""
        heapq.heappush(self._scheduled, timer)  # type: ignore[attr-defined]
        timer._scheduled = True  # type: ignore[attr-defined]

    # The signatures are asyncio's; what pymodbus and the simulator pass is all that is looked at.

    def number(self, file: MemoryFile) -> int:
        """Make up a descriptor, one that no real file has."""
        number = -2 - len(self._files)
        self._files[number] = file
        return number

    def add_reader(self, fd: Any, callback: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        if (file := self._files.get(fd)) is not None:
            return file.watch("read", functools.partial(callback, *args))
        return super().add_reader(fd, callback, *args)

    def remove_reader(self, fd: Any) -> Any:
        if (file := self._files.get(fd)) is not None:
            return file.watch("read", None)
        return super().remove_reader(fd)

    def add_writer(self, fd: Any, callback: Callable[..., Any], *args: Any) -> Any:  # type: ignore[override]
        if (file := self._files.get(fd)) is not None:
            return file.watch("write", functools.partial(callback, *args))
        return super().add_writer(fd, callback, *args)

    def remove_writer(self, fd: Any) -> Any:
        if (file := self._files.get(fd)) is not None:
            return file.watch("write", None)
        return super().remove_writer(fd)

    async def create_server(self, factory: Any, _host: Any = None, port: Any = None, **_: Any) -> Any:  # type: ignore[override]
        if not port:
            port = next(_PORTS)
        return _Listener(self._listeners, factory, port)

    async def create_connection(self, factory: Any, _host: Any = None, port: Any = None, **_: Any) -> Any:  # type: ignore[override]
        await asyncio.sleep(2 * LATENCY_S)
        transport = self.connect(factory, port)
        return transport, transport.protocol

    def connect(self, factory: Callable[[], Any], port: int) -> MemoryTransport:
        """Connect at once."""
        listener = self._listeners.get(port)
        if listener is None:
            raise ConnectionRefusedError(111, "no server listens")
        here, there = MemoryTransport(self), MemoryTransport(self)
        here.peer, there.peer = there, here
        there.attach(listener.factory())
        here.attach(factory())
        return here


class _Listener:
    """The part of create_server's result that is used."""

    def __init__(self, listeners: dict[int, _Listener], factory: Callable[[], Any], port: int) -> None:
        self.factory = factory
        self._listeners, self._port = listeners, port
        if port in listeners:
            raise OSError(98, "address in use")
        listeners[port] = self
        self.sockets = [self]

    def getsockname(self) -> tuple[str, int]:
        return "127.0.0.1", self._port

    def is_serving(self) -> bool:
        return self._listeners.get(self._port) is self

    def close(self) -> None:
        if self.is_serving():
            del self._listeners[self._port]


class MemoryTransport(asyncio.Transport):
    """One end of a connection."""

    def __init__(self, loop: VirtualLoop) -> None:
        super().__init__()
        self._loop = loop
        self._closing = False
        self._resets = False
        self._arriving: deque[bytes | ConnectionResetError | None] = deque()
        self._is_paused = False
        self._passed_over = 0
        """Deliveries due while reading was paused."""
        self.peer: MemoryTransport
        self.protocol: Any = None

    def attach(self, protocol: Any) -> None:
        self.protocol = protocol
        protocol.connection_made(self)

    def write(self, data: Any) -> None:
        if not self._closing:
            self.peer.send_here(bytes(data))

    def send_here(self, what: bytes | ConnectionResetError | None) -> None:
        # Timers of the same instant come in any order; the queue keeps the bytes in theirs.
        self._arriving.append(what)
        self._loop.call_later(LATENCY_S, self._arrive)

    def pause_reading(self) -> None:
        self._is_paused = True

    def resume_reading(self) -> None:
        self._is_paused = False
        for _ in range(self._passed_over):
            self._loop.call_soon(self._arrive)
        self._passed_over = 0

    def _arrive(self) -> None:
        if self._is_paused:
            self._passed_over += 1
            return
        what = self._arriving.popleft()
        if self._closing:
            return
        if isinstance(what, bytes):
            self.protocol.data_received(what)
        else:
            if what is None:
                self.protocol.eof_received()
            self._lose(what)

    def _lose(self, why: Exception | None) -> None:
        if not self._closing:
            self._closing = True
            self._loop.call_soon(self.protocol.connection_lost, why)

    def close(self) -> None:
        if not self._closing:
            self.peer.send_here(ConnectionResetError(104, "reset by peer") if self._resets else None)
            self._lose(None)

    abort = close

    def is_closing(self) -> bool:
        return self._closing

    def get_write_buffer_size(self) -> int:
        return 0  # what is written is on its way

    def get_extra_info(self, name: str, default: Any = None) -> Any:
        return {"socket": self, "peername": ("memory", 1), "sockname": ("memory", 2)}.get(name, default)

    def setsockopt(self, _level: int, option: int, _value: object) -> None:
        """One option counts here, the simulator's: to reset the connection in place of closing it."""
        self._resets |= option == socket.SO_LINGER


class MemoryFile:
    """A file to a virtual loop, which calls back in each turn in which there is something to do.

    Looking at a real descriptor costs a system call in every turn of the loop, and two for every write.
    """

    def __init__(self, loop: VirtualLoop) -> None:
        self._loop = loop
        self._number = loop.number(self)
        self._inbox = b""
        self._has_ended = False
        self._wanted: dict[str, Callable[[], object]] = {}
        self._is_due = False

    def fileno(self) -> int:
        return self._number

    def arrive(self, data: bytes) -> None:
        """Here are bytes to be read."""
        self._inbox += data
        self._look()

    def end(self) -> None:
        """There will be no more."""
        self._has_ended = True
        self._look()

    def read(self, size: int) -> bytes:
        """Some of what has arrived."""
        data, self._inbox = self._inbox[:size], self._inbox[size:]
        return data

    def watch(self, what: str, call: Callable[[], object] | None) -> bool:
        """Watch for something to "read" or for room to "write"; whether that was watched for before."""
        was_wanted = self._wanted.pop(what, None) is not None
        if call is not None:
            self._wanted[what] = call
            self._look()
        return was_wanted

    def _look(self) -> None:
        is_readable = "read" in self._wanted and (self._inbox or self._has_ended)
        if not self._is_due and (is_readable or "write" in self._wanted):
            self._is_due = True
            self._loop.call_soon(self._call)

    def _call(self) -> None:
        self._is_due = False
        if "read" in self._wanted and (self._inbox or self._has_ended):
            self._wanted["read"]()
        if "write" in self._wanted:
            self._wanted["write"]()
        self._look()


def run(main: Callable[[], Coroutine[Any, Any, T]], limit: float = math.inf) -> T:
    """Run a coroutine function in a virtual loop; nothing may be left running or complained about.

    Raises:
        AssertionError: a task was left, the loop had to complain, or ``limit`` virtual seconds have passed.
    """
    with asyncio.Runner(loop_factory=VirtualLoop) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, VirtualLoop)
        loop.end_after(limit)
        result = runner.run(main())
        left = asyncio.all_tasks(loop)
        assert not left, f"tasks left running: {left}"
        assert not loop.complaints, f"the event loop complained: {loop.complaints}"
        return result


async def until(condition: Callable[[], bool]) -> None:
    """Wait until something is true, with a look at every millisecond: a gripper sends no events."""
    loop = asyncio.get_running_loop()
    while not condition():
        turn = loop.create_future()
        loop.call_later(0.001, turn.set_result, None)
        await turn


def virtual(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Let a coroutine function be a test that runs in a virtual loop."""

    @functools.wraps(test)
    def in_virtual_time(**arguments: Any) -> None:
        run(lambda: test(**arguments))

    return in_virtual_time


OPENED = ("hand", "reader")


def inside(
    scene: Callable[..., AbstractAsyncContextManager[Any]], *given: str, **options: Any
) -> Callable[[Callable[..., Coroutine[Any, Any, None]]], Callable[..., None]]:
    """Let a coroutine function be a test inside a scene, in a virtual loop.

    The test gets what it has parameters for: ``here`` is the scene; ``hand`` and ``reader`` are what its
    methods of these names open.

    Args:
        scene: opens the scene.
        given: names of arguments, of a parametrization or fixtures, that the scene takes.
        options: other arguments of the scene.
    """

    def decorate(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
        wanted = inspect.signature(test).parameters

        async def main(arguments: dict[str, Any]) -> None:
            async with AsyncExitStack() as stack:
                here = await stack.enter_async_context(
                    scene(**{each: arguments[each] for each in given}, **options)
                )
                found = {**arguments, "here": here}
                for name in [each for each in wanted if each in OPENED]:
                    found[name] = await stack.enter_async_context(getattr(here, name)())
                await test(**{name: found[name] for name in wanted})

        @functools.wraps(test)
        def in_scene(**arguments: Any) -> None:
            run(lambda: main(arguments), LIMIT_S)

        names = dict.fromkeys([*given, *(name for name in wanted if name not in {"here", *OPENED})])
        kind = inspect.Parameter.KEYWORD_ONLY
        in_scene.__signature__ = inspect.Signature([inspect.Parameter(name, kind) for name in names])  # type: ignore[attr-defined]
        return in_scene

    return decorate
