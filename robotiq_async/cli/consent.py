"""The question before a gripper moves; commands ask nowhere else.

A command that moves asks at a terminal, and without one needs ``--yes``. The gripper of sim:// is part of the
command and harmless. Any other address may be a real gripper, also the address of a simulator.
"""

from __future__ import annotations

import select
import sys
from contextlib import suppress
from typing import TextIO

from .addresses import full_address, is_simulated
from .failures import CommandError, UsageError

NOTE = "Nothing here has run on real hardware yet: keep a hand on the emergency stop."


def consent(address: str, what: str, *, yes: bool) -> None:
    """Return when the user has agreed that a gripper moves; nothing has been sent before.

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
    print(f"{gripper}: {what}\n{NOTE}\nContinue? [y/N] ", end="", file=screen, flush=True)
    _wait_for_key()
    if read_line().strip().lower() not in ("y", "yes"):
        raise CommandError(f"nothing was sent to the gripper at {gripper}: the answer was not yes")


def forget_keys() -> None:
    """Discard keys from before the question or the screen was there: they are no answers or commands."""
    with suppress(ImportError, OSError):  # Windows, or no terminal
        import termios

        termios.tcflush(sys.stdin, termios.TCIFLUSH)


def read_line() -> str:
    """The next line of standard input, at most 1000 bytes; empty at its end."""
    return "" if sys.stdin is None else sys.stdin.buffer.readline(1000).decode(errors="replace")


def _wait_for_key() -> None:
    # A signal that comes just before a read blocks, or that the system hands to another thread, does not
    # interrupt the read: Ctrl-C would be lost. Between two waits its handler runs.
    with suppress(OSError, ValueError):  # Windows waits for sockets only
        while not select.select([sys.stdin], [], [], 0.1)[0]:
            pass


def _screen() -> TextIO | None:
    if sys.stdin is None or not sys.stdin.isatty():
        return None
    return next((each for each in (sys.stdout, sys.stderr) if each is not None and each.isatty()), None)
