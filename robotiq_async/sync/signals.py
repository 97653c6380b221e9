"""Signals that end a program of blocking hands."""

from __future__ import annotations

import asyncio
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any, Final

from ..runtime.concurrency import LateError
from ..runtime.logger import log
from ..runtime.signals import INSIST_S, check_main_thread, ending_signals, pass_on
from ..values.errors import NotStartedError
from .loop_thread import LOOP_THREAD
from .robotiq_hand import RobotiqHand, caller_of

SIGNAL_STOP_S: Final = 4.0  # a stop takes 2 s at most


class _SignalError(BaseException):
    """Leaves the block of stops_on_signals(), as a KeyboardInterrupt would."""


@contextmanager
def stops_on_signals(*hands: RobotiqHand) -> Iterator[None]:
    """Stop blocking hands on SIGINT, SIGTERM and SIGHUP, and then leave the block.

    Without it SIGTERM ends a program at once, and the fingers keep moving; and the first process of a
    container (PID 1) does not get SIGTERM at all. The stops run in the thread of the hands, also in a busy
    program. Then the call that it waits for, if any, is cancelled, and the program continues after the block.
    Further signals are ignored for 3 s after the stops; later ones act as before the block. An ignored signal
    stays ignored. SIGKILL stops nothing.

    Args:
        hands: to stop; a hand that does not run is left alone.

    Raises:
        TypeError: an argument is not a blocking hand.
        RuntimeError: not in the main thread.
    """
    for each in hands:
        if not isinstance(each, RobotiqHand):
            raise TypeError(f"hands must be blocking hands, got {each!r}")
    check_main_thread()
    is_received, stopped_at = False, float("inf")

    def handle(number: int, frame: FrameType | None) -> None:
        nonlocal is_received, stopped_at
        if is_received:
            if time.monotonic() - stopped_at > INSIST_S:
                pass_on(previous[number], number, frame)
            return
        is_received = True
        _stop(hands)
        stopped_at = time.monotonic()
        raise _SignalError

    previous: dict[int, Any] = {number: signal.signal(number, handle) for number in ending_signals()}
    try:
        yield
    except _SignalError:
        pass
    except NotStartedError:
        if not is_received:
            raise
    finally:
        for number, handler in previous.items():
            signal.signal(number, handler)


def _stop(hands: tuple[RobotiqHand, ...]) -> None:
    """Stop all running hands at the same time. Without the thread of the hands no hand runs."""
    running = [caller for caller in map(caller_of, hands) if caller.is_in_use]
    if not running or not LOOP_THREAD.is_running:
        return

    async def stop() -> None:
        for stopped in await asyncio.gather(*(each.hand.stop() for each in running), return_exceptions=True):
            if isinstance(stopped, BaseException):
                log.error("a hand could not be stopped: %r", stopped)

    with suppress(LateError):
        LOOP_THREAD.call(stop, limit=SIGNAL_STOP_S)
