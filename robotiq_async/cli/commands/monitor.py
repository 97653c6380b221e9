"""``robotiq-async monitor`` and ``status``."""

from __future__ import annotations

import asyncio
import json
import os
import sys
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Annotated, Final

from cyclopts import Parameter

from ...hands import Hand
from ...tools.recording.payloads import reading_fields
from ...values import DEFAULT_FORCE, DEFAULT_SPEED
from ..addresses import gripper_words
from ..arguments import USUAL_LINK, AddressArgument, Byte, Flag, LinkOptions, need
from ..consent import forget_keys
from ..failures import CommandError, UsageError, normal_end
from ..output.messages import forget, forwarded_warnings, tell

SCREEN_S: Final = 1.0
"""Maximum time for the screen to restore the terminal."""


async def monitor(
    address: AddressArgument = "sim://",
    /,
    *,
    watch: Flag = False,
    as_json: Annotated[Flag, Parameter(name="--json")] = False,
    speed: Byte = DEFAULT_SPEED,
    force: Byte = DEFAULT_FORCE,
    link: LinkOptions = USUAL_LINK,
) -> None:
    """Show a gripper while it works, and move it by keys. Nothing moves until a key is pressed.

    The screen shows the state, the fault, and for each axis position, requested position,
    object status and current; polling statistics; and a log. A lost gripper is shown as
    lost until the monitor has reconnected.

    Keys:

        o c      open, close
        1 2 3    the scissor wide, normal, pinch
        SPACE    halt
        + -      speed
        ] [      force
        p        any position of any axes: a prompt takes them
        a r l v  activate, reset, release, recover: ask first
        q        quit

    Quitting stops the fingers only if they were moved from here.

    Without a terminal, for example in a pipe, it prints the lines of --json.

    For example:

        robotiq-async monitor tcp://192.168.1.11
        robotiq-async monitor --watch 192.168.1.11
        robotiq-async monitor --json 192.168.1.11 | jq .A.position

    Args:
        speed: Speed of all axes from the first command on; the present one cannot be read.
        force: Force of all axes from the first command on. A grip made with more loosens.
        watch: Print a line for every change, until Ctrl-C; take no commands.
        as_json: Print every poll and event as a line of JSON; take no commands.
    """
    if watch and as_json:
        raise UsageError("--watch and --json cannot be combined")
    with normal_end():
        if watch or as_json or not _is_terminal():
            await _look(address, link, as_json=not watch)
        else:
            need("textual", "monitor", ", or pass --watch")
            await _screen(address, link, speed, force)


def _is_terminal() -> bool:
    # All three: the screen is drawn on standard error.
    streams = (sys.stdin, sys.stdout, sys.stderr)
    return all(each is not None and each.isatty() for each in streams) and os.environ.get("TERM") != "dumb"


async def _look(address: str, link: LinkOptions, *, as_json: bool) -> None:
    from ..output.lines import print_objects, watch

    async with _named(address, link, as_json=as_json) as hand:
        await (print_objects if as_json else watch)(hand)
    raise CommandError("the hand has failed; the reason is above")


@asynccontextmanager
async def _named(address: str, link: LinkOptions, *, as_json: bool) -> AsyncIterator[Hand]:
    """A hand that is only watched; the line that names the gripper is not among the JSON."""
    from ..connect import connected

    if not as_json:
        print(gripper_words(address), flush=True)
    async with connected(address, link, halt=False) as hand:
        if as_json:
            tell(gripper_words(address))
        yield hand


async def _screen(address: str, link: LinkOptions, speed: int, force: int) -> None:
    from ..connect import make_operator
    from ..tui.screen import Monitor

    operator = make_operator(address, link, "the monitor", speed=speed, force=force)
    await operator.hand.start(activate=False)
    screen, words = None, ""
    try:
        screen = Monitor(operator)
        forget_keys()
        showing = asyncio.ensure_future(screen.run_async())
        with forwarded_warnings(screen.write_log, of=operator.hand.name):
            await asyncio.wait({showing})
    finally:
        # First the fingers: a screen whose terminal has gone may take long, or never end.
        words = await operator.leave()
        if screen is not None:
            showing.cancel()
            await asyncio.wait({showing}, timeout=SCREEN_S)
        try:
            print(words, flush=True)
        except OSError:  # the terminal is gone
            forget(sys.stdout)
    if screen.return_code:
        raise CommandError("the screen failed; its message is above")


async def status(
    address: AddressArgument = "sim://",
    /,
    *,
    as_json: Annotated[Flag, Parameter(name="--json")] = False,
    link: LinkOptions = USUAL_LINK,
) -> None:
    """Read the gripper once and print its status. Nothing moves and nothing is written.

    For example:

        robotiq-async status tcp://192.168.1.11
        robotiq-async status --json 192.168.1.11 | jq .A.position

    Args:
        as_json: Print one JSON object instead of the table.
    """
    from ..output.tables import print_status

    async with _named(address, link, as_json=as_json) as hand:
        if as_json:
            print(json.dumps(reading_fields(hand), indent=2))
        else:
            print_status(hand)
