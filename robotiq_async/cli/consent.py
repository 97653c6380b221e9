"""The question before a gripper moves; commands ask nowhere else.

A command that moves asks at a terminal, and without one needs ``--yes``. The gripper of sim:// is part of the
command and harmless. Any other address may be a real gripper, also the address of a simulator.
"""

from __future__ import annotations

import os
import select
import sys
from contextlib import suppress
from typing import Final, TextIO
from weakref import WeakKeyDictionary

from .addresses import full_address, is_simulated
from .failures import CommandError, UsageError

LONGEST_ANSWER: Final = 1000
"""Bytes of a line at most."""
_typed: Final[WeakKeyDictionary[TextIO, bytearray]] = WeakKeyDictionary()
"""The bytes that came from a stream after the last line that was read."""
NEVER_RUN_NOTE = "Nothing here has run on real hardware yet: keep a hand on the emergency stop."


def consent(address: str, what: str, *, yes: bool) -> None:
    """Return when the user has agreed that a gripper moves; nothing has been sent before.

    Raises:
        UsageError: there is no terminal to ask at, or the address is malformed.
        CommandError: the answer is not yes.
    """
    gripper = full_address(address)
    if yes or is_simulated(address):
        return
    screen = screen_to_ask_at(address)
    forget_keys()
    print(f"{gripper}: {what}\n{NEVER_RUN_NOTE}\nContinue? [y/N] ", end="", file=screen, flush=True)
    if read_line().strip().lower() not in ("y", "yes"):
        raise CommandError(f"nothing was sent to the gripper at {gripper}: the answer was not yes")


def screen_to_ask_at(address: str) -> TextIO:
    """The screen for the question before a gripper moves.

    Raises:
        UsageError: there is no terminal to ask at, or the address is malformed.
    """
    screen = _screen()
    if screen is None:
        raise UsageError(
            f"this moves the gripper at {full_address(address)}; without a terminal to ask at it needs --yes"
        )
    return screen


def forget_keys() -> None:
    """Discard keys from before the question or the screen was there: they are no answers or commands."""
    _typed.clear()
    with suppress(ImportError, OSError):  # Windows, or no terminal
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def read_line() -> str:
    """The next line of standard input, at most 1000 bytes; empty at its end. In any thread."""
    if sys.stdin is None:
        return ""
    try:
        line = _next_line(sys.stdin.fileno(), _typed.setdefault(sys.stdin, bytearray()))
    except (OSError, ValueError):  # Windows waits for sockets only
        line = sys.stdin.buffer.readline(LONGEST_ANSWER)
    return line.decode(errors="replace")


def _next_line(stream: int, typed: bytearray) -> bytes:
    # Not by the stream itself. A signal that comes just before its read blocks, or that the system hands to
    # another thread, does not interrupt it: Ctrl-C would be lost. And a thread that waits in it holds its
    # lock, without which the interpreter cannot end: it aborts.
    while b"\n" not in typed and len(typed) < LONGEST_ANSWER:
        while not select.select([stream], [], [], 0.1)[0]:
            pass
        if not (data := os.read(stream, LONGEST_ANSWER)):
            break
        typed.extend(data)
    end = (typed.find(b"\n") + 1) or len(typed)
    line = bytes(typed[: min(end, LONGEST_ANSWER)])
    del typed[: len(line)]
    return line


def _screen() -> TextIO | None:
    if sys.stdin is None or not sys.stdin.isatty():
        return None
    return next((each for each in (sys.stdout, sys.stderr) if each is not None and each.isatty()), None)
