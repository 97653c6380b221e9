"""The signals that end a program."""

from __future__ import annotations

import signal
from typing import Final

ENDING: Final = ("SIGINT", "SIGTERM", "SIGHUP", "SIGBREAK")
"""Ctrl-C, ``kill``, a closed terminal, and Ctrl-Break on Windows. There a closed console ends the process at
once, whatever handles SIGBREAK, which it raises too."""


def ending_signals() -> list[signal.Signals]:
    """Those of :data:`ENDING` that the system has and that are not ignored.

    An ignored signal stays ignored: that is how a shell keeps Ctrl-C from its background jobs.
    """
    numbers = [getattr(signal, name) for name in ENDING if hasattr(signal, name)]
    return [number for number in numbers if signal.getsignal(number) is not signal.SIG_IGN]
