"""The signals that end a program."""

from __future__ import annotations

import signal
import threading
from types import FrameType
from typing import Final

INSIST_S: Final = 3.0
"""Seconds after a signal in which further ones are ignored. A stop takes 2 s at most."""
ENDING: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Ctrl-C, ``kill``, a closed terminal, and Ctrl-Break on Windows. There a closed console raises
SIGBREAK too, and ends the process at once, even if a handler is set."""


def check_main_thread() -> None:
    """Raise RuntimeError in any thread but the one that signals reach."""
    if threading.current_thread() is not threading.main_thread():
        raise RuntimeError("signals reach the main thread alone: enter stops_on_signals() there")


def ending_signals() -> list[signal.Signals]:
    """The signals of :data:`ENDING` that the system has and that are not ignored.

    An ignored signal stays ignored: that is how a shell keeps Ctrl-C from its background jobs.
    """
    numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]


def pass_on(handler: object, number: int, frame: FrameType | None) -> None:
    """Let a signal act as it would with this handler."""
    if callable(handler):
        handler(number, frame)
    else:
        signal.signal(number, signal.SIG_DFL)
        signal.raise_signal(number)
