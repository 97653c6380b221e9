"""The event loop that a hand belongs to: a call from anywhere else is refused before it asks for anything."""

from __future__ import annotations

import asyncio


def running_loop() -> asyncio.AbstractEventLoop:
    """The running asyncio event loop.

    Raises:
        RuntimeError: there is none: called outside of a coroutine, or under trio.
    """
    try:
        return asyncio.get_running_loop()
    except RuntimeError:
        raise RuntimeError(
            "robotiq_async needs a running asyncio event loop (asyncio or uvloop; trio is not supported)"
        ) from None


def check_loop(own: asyncio.AbstractEventLoop, what: str) -> None:
    """Refuse a call that does not come from the loop a hand runs in.

    Args:
        own: the hand's loop.
        what: was called, for the message.

    Raises:
        RuntimeError: called from another thread, another event loop or another framework.
    """
    try:
        running: asyncio.AbstractEventLoop | None = asyncio.get_running_loop()
    except RuntimeError:
        running = None
    if running is not own:
        raise RuntimeError(
            f"{what} was used outside of the event loop that the hand runs in, and nothing was asked of the "
            "gripper; from another thread use loop.call_soon_threadsafe(hand.command, ...) or "
            "asyncio.run_coroutine_threadsafe(hand.move(...), loop)"
        )
