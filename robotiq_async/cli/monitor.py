"""``robotiq-async monitor``."""

from __future__ import annotations

import asyncio
import os
import sys
from contextlib import suppress
from typing import Annotated

from cyclopts import Parameter

from .arguments import USUAL, Address, CommandError, Link, UsageError, need


async def monitor(
    address: Address = "sim://",
    /,
    *,
    watch: Annotated[bool, Parameter(negative=())] = False,
    as_json: Annotated[bool, Parameter(name="--json", negative=())] = False,
    link: Link = USUAL,
) -> None:
    """Show a gripper while it works, and move it by keys. Nothing moves until a key is pressed.

    The screen shows the state, the fault in words, and for each axis where it is, where
    it is asked to go, what it does and its current; how the polling goes; and a log.
    A lost gripper is shown as lost, and comes back by itself.

    Keys: o open, c close, 1 2 3 the widths of the scissor, SPACE halt, + - speed,
    ] [ force, v recover, a activate, r reset, l release in a fault, q quit. The last
    four before q ask first. Quitting stops the fingers only if they were moved from here.

    Without a terminal, in a pipe say, it prints what --json prints, and only looks.

    For example:

        robotiq-async monitor tcp://192.168.1.11
        robotiq-async monitor --watch 192.168.1.11
        robotiq-async monitor --json 192.168.1.11 | jq .A.position

    Args:
        watch: Only look, and print a line for whatever changes, until Ctrl-C.
        as_json: Only look, and print every poll and event as a JSON object a line.
    """
    if watch and as_json:
        raise UsageError("--watch and --json exclude each other")
    try:
        if watch or as_json or not _is_terminal():
            await _look(address, link, as_json=not watch)
            return
        need("textual", "monitor", ", or pass --watch")
        await _screen(address, link)
    except asyncio.CancelledError:
        pass  # Being told to stop is how this command ends well.


def _is_terminal() -> bool:
    """Whether there is somebody to look at a screen (which is drawn on standard error) and to press keys."""
    streams = (sys.stdin, sys.stdout, sys.stderr)
    return all(each is not None and each.isatty() for each in streams) and os.environ.get("TERM") != "dumb"


async def _look(address: str, link: Link, *, as_json: bool) -> None:
    from .connection import connected
    from .lines import print_objects, watch
    from .remarks import told

    async with connected(address, link, halt=False) as hand:
        with told(lambda remark: print("robotiq-async:", remark, file=sys.stderr, flush=True)):
            await (print_objects if as_json else watch)(hand)


async def _screen(address: str, link: Link) -> None:
    from ..actions import Operator
    from .connection import make_hand, operated
    from .remarks import told
    from .screen import Monitor

    operator = Operator(make_hand(address, link))
    async with operated(operator, _say):
        screen = Monitor(operator)
        with told(screen.remark):
            await screen.run_async()
    if screen.return_code and not _is_cancelled():
        raise CommandError("the screen failed; what it says is above")


def _is_cancelled() -> bool:
    """Whether a signal has come; a screen whose terminal is gone may fail then."""
    task = asyncio.current_task()
    return task is not None and task.cancelling() > 0


def _say(words: str) -> None:
    with suppress(OSError):  # the terminal may be gone
        print(words, flush=True)
