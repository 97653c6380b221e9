"""Work that ends well, whatever happens to those who wait for it."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import Callable
from typing import Any, TypeVar

import anyio

T = TypeVar("T")


class LateError(Exception):
    """A call was not done in time."""


async def wait_shielded(work: asyncio.Future[Any]) -> None:
    """Wait until something is done, also when cancelled meanwhile; the cancellation is raised afterwards.

    What the work itself raises is not raised here: ask it for its result.
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
    """Begin what may block for ever (a disk, a pipe) in a thread of its own.

    Nobody has to wait for it: neither the loop's end nor the interpreter's does, and a program whose own
    threads are all busy does not hold it up.
    """
    loop = asyncio.get_running_loop()
    future: asyncio.Future[T] = loop.create_future()

    def tell(how: Callable[[Any], None], what: object) -> None:
        def say() -> None:
            if not future.done():
                how(what)

        with contextlib.suppress(RuntimeError):  # the loop has been closed meanwhile
            loop.call_soon_threadsafe(say)

    def run() -> None:
        try:
            result = work()
        except Exception as error:  # noqa: BLE001  # whoever waits gets it
            tell(future.set_exception, error)
        else:
            tell(future.set_result, result)

    threading.Thread(target=run, name="robotiq_async", daemon=True).start()
    return future
