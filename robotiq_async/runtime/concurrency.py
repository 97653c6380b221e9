"""Work that must finish, threads for calls that may block, and the event loop that a hand belongs to."""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
import sys
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import anyio

T = TypeVar("T")


class NoThreadError(OSError):
    """No thread can be started now."""


class LateError(Exception):
    """A call did not finish in time."""


async def wait_shielded(work: asyncio.Future[Any]) -> None:
    """Wait until the work is done, even when cancelled; then raise the cancellation.

    Does not raise the error of the work: read the future's result.
    """
    cancelled: asyncio.CancelledError | None = None
    with anyio.CancelScope(shield=True):
        while not work.done():
            try:
                await asyncio.wait({work})
            except asyncio.CancelledError as error:
                cancelled = error
    if cancelled is not None:
        raise cancelled


def in_a_thread(work: Callable[[], T]) -> asyncio.Future[T]:
    """Start a call that may block for ever (a disk, a pipe) in a separate daemon thread.

    Neither the end of the loop nor the end of the interpreter waits for it, and a full thread pool does not
    delay it. If the system starts no thread, awaiting the result raises a :class:`NoThreadError`.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def tell(how: Callable[[Any], None], what: object) -> None:
        def say() -> None:
            if not future.done():
                how(what)

        with contextlib.suppress(RuntimeError):  # the loop has been closed
            loop.call_soon_threadsafe(say)

    def run() -> None:
        try:
            result = work()
        except Exception as error:  # noqa: BLE001  # raised where the future is awaited
            tell(future.set_exception, error)
        else:
            tell(future.set_result, result)

    try:
        threading.Thread(target=run, name="robotiq_async", daemon=True).start()
    except RuntimeError as error:
        future.set_exception(NoThreadError(errno.EAGAIN, str(error)))
    return future


def write_all(descriptor: int, data: bytes) -> None:
    """Write all of the data. Blocks until the other side has taken it: call it in a thread.

    It bypasses Python's buffers: at exit the interpreter would wait for a thread that uses one.

    Raises:
        OSError: it cannot be written.
    """
    left = memoryview(data)
    while left:
        left = left[os.write(descriptor, left) :]


def green_threads() -> str:
    """The library that has replaced Python's threads, gevent or eventlet; empty without one.

    A thread is then a part of the thread that starts it: an event loop in it would not run while that waits.
    """
    gevent, eventlet = sys.modules.get("gevent.monkey"), sys.modules.get("eventlet.patcher")
    if gevent is not None and gevent.is_module_patched("threading"):
        return "gevent"
    return "eventlet" if eventlet is not None and eventlet.is_monkey_patched("thread") else ""


def running_loop() -> asyncio.AbstractEventLoop:
    """The running asyncio event loop."""
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        raise RuntimeError(
            "robotiq_async needs a running asyncio event loop (asyncio or uvloop; trio is not supported)"
        ) from None


def check_loop(own: asyncio.AbstractEventLoop, what: str) -> None:
    """Refuse a call that does not come from the loop a hand runs in, or if that loop was closed."""
    if own.is_closed():
        raise RuntimeError(
            "the event loop that the hand ran in was closed before stop(), and the fingers may still move: "
            "make a new hand"
        )
    try:
        running: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
    except RuntimeError:
        running = None
    if running is not own:
        raise RuntimeError(
            f"{what} was used outside of the event loop that the hand runs in, and nothing was sent to the "
            "gripper; from another thread use loop.call_soon_threadsafe(hand.command, ...) or "
            "asyncio.run_coroutine_threadsafe(hand.move(...), loop)"
        )
