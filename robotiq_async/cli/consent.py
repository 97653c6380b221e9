"""The question before a gripper moves: the one place where a command asks.

A command that moves asks at a terminal, and without one needs ``--yes``. The gripper behind sim:// is part of
the command and hurts nobody; any other address may be a real gripper's, also that of a simulator elsewhere.
"""

from __future__ import annotations

import sys
from contextlib import suppress
from typing import TextIO

from .addresses import full_address, is_simulated
from .failures import CommandError, UsageError

NOTE = "Nothing here has run on real hardware yet: keep a hand on the emergency stop."


def consent(address: str, what: str, *, yes: bool) -> None:
    """Return when somebody has agreed that a gripper moves; nothing has been sent before.

    Args:
        address: the gripper.
        what: what will happen to it.
        yes: ``--yes``: somebody has.

    Raises:
        UsageError: there is no terminal to ask at, or the address is malformed.
        CommandError: the answer is not yes.
    """
    gripper = full_address(address)
    if yes or is_simulated(address):
        return
    screen = _screen()
    if screen is None:
        raise UsageError(f"this moves the gripper at {gripper}; without a terminal to ask at it needs --yes")
    forget_keys()
    print(f"{gripper}: {what}\n{NOTE}\nGo on? [y/N] ", end="", file=screen, flush=True)
    if read_line().strip().lower() not in ("y", "yes"):
        raise CommandError(f"nothing was sent to the gripper at {gripper}: the answer was not yes")


def forget_keys() -> None:
    """What was typed before there was something to look at is no answer, and no command."""
    with suppress(ImportError, OSError):  # Windows; no terminal
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def read_line() -> str:
    """The next line of standard input, whatever it has, at most 1000 bytes; empty when there is none."""
    return "" if sys.stdin is None else sys.stdin.buffer.readline(1000).decode(errors="replace")


def _screen() -> TextIO | None:
    """Where a person who can answer sees a question: not in the file that standard output may be."""
    if sys.stdin is None or not sys.stdin.isatty():
        return None
    return next((each for each in (sys.stdout, sys.stderr) if each is not None and each.isatty()), None)
