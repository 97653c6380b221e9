"""``robotiq-async web``."""

from __future__ import annotations

import asyncio
from collections.abc import Sequence
from contextlib import AsyncExitStack
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Final

from cyclopts import Parameter

from ...runtime import wait_shielded
from ...tools.actions import Operator
from ...tools.recording.payloads import title
from ...values import DEFAULT_FORCE, DEFAULT_SPEED, RobotiqError
from ..addresses import gripper_words
from ..arguments import USUAL_LINK, AddressArgument, Byte, Flag, Host, LinkOptions, Port, need
from ..browser import opened
from ..failures import CommandError, UsageError, file_errors, normal_end, usage
from ..output.messages import tell

if TYPE_CHECKING:
    from ...tools.web.server import HandUpdates, PageServer
    from ...tools.web.settings import PageSettings

AGAIN_S: Final = 3.0
"""Pause between two attempts to reach one of several grippers."""


async def web(
    *addresses: AddressArgument,
    control: Flag = False,
    open_browser: Annotated[Flag, Parameter(name="--open")] = False,
    port: Port = 8766,
    host: Host = "127.0.0.1",
    password_file: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    certificate: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    key: Annotated[Path | None, Parameter(metavar="FILE")] = None,
    speed: Byte = DEFAULT_SPEED,
    force: Byte = DEFAULT_FORCE,
    link: LinkOptions = USUAL_LINK,
) -> None:
    """Show grippers on a page in the browser, the hand in three dimensions, until Ctrl-C.

    It prints the address to open; the token in the address lets its users in. The page
    only watches, unless --control is given: then it has buttons, and a halt that is also on
    the space bar. Nothing moves until a button is pressed. With several addresses there is
    a tile for each.

    Closing the browser, or losing its connection, holds the axes that it has set in
    motion. Ending this command stops the fingers only if they were moved from here.

    For example:

        robotiq-async web --open
        robotiq-async web --control tcp://192.168.1.11
        robotiq-async web 192.168.1.11 192.168.1.12

    Args:
        control: Let the page command the grippers.
        open_browser: Open the page in a browser.
        port: TCP port; 0 takes a free one.
        host: Interface to listen on. All but 127.0.0.1 let others in, and need a password or a certificate.
        password_file: File whose first line is the password, instead of the token.
        certificate: Your certificate in PEM, for https.
        key: Its private key in PEM.
        speed: Speed of all axes from the first command on; the present speed cannot be read.
        force: Force of all axes from the first command on. A grip made with more force loosens.
    """
    need("nicegui", "web")
    from ...tools.web.server import PageServer
    from ...tools.web.settings import PageSettings
    from ..connect import make_operator
    from ..output.messages import forwarded_warnings

    shown = addresses or ("sim://",)
    operators = [make_operator(each, link, "the page", speed=speed, force=force) for each in shown]
    with usage():
        settings = PageSettings(
            host=host,
            port=port,
            control=control,
            addresses=tuple(title(operator.hand) for operator in operators),
            speed=speed,
            force=force,
            password=_password(password_file),
            certificate=_readable(certificate),
            key=_readable(key),
        )
    _refuse_doubles(settings.addresses)
    page = PageServer(
        [operator.hand for operator in operators], settings, operators=operators if control else ()
    )
    with normal_end(), forwarded_warnings(tell):
        await _show(page, operators, settings, shown, open_browser=open_browser)


async def _show(
    page: PageServer,
    operators: Sequence[Operator],
    settings: PageSettings,
    shown: Sequence[str],
    *,
    open_browser: bool,
) -> None:
    async with page, AsyncExitStack() as stack:
        try:
            for index, operator in enumerate(operators):
                await _start(page, index, operator, alone=len(operators) == 1, stack=stack)
            if all(updates.problem for updates in page.updates):
                raise CommandError("; ".join(updates.problem for updates in page.updates))
            for address in shown:
                tell(gripper_words(address))
            if not settings.loopback and not settings.certificate:
                tell("without a certificate everyone on the network can read the password")
            print(page.url, flush=True)
            if open_browser and not await stack.enter_async_context(opened(page.url)):
                tell("no browser could be opened here: open the address above yourself")
            await page.ended()
            raise CommandError("the process of the page has ended; its message is above")
        finally:
            # First, so that neither the page nor an unreachable gripper delays it.
            await _leave_all(operators, page)


async def _start(
    page: PageServer, index: int, operator: Operator, *, alone: bool, stack: AsyncExitStack
) -> None:
    """Start a hand. One of several that cannot be reached is tried again, and marked on the page."""
    updates = page.updates[index]
    try:
        await operator.hand.start(activate=False)
    except RobotiqError as error:
        updates.note_start(str(error))
        if alone:
            raise
        trying = asyncio.get_running_loop().create_task(_try_again(page, index, operator))
        stack.push_async_callback(_cancelled, trying)
    updates.open()


async def _try_again(page: PageServer, index: int, operator: Operator) -> None:
    updates = page.updates[index]
    while updates.problem:
        await asyncio.sleep(AGAIN_S)
        if page.is_ending:
            return
        try:
            await operator.hand.start(activate=False)
        except RobotiqError as error:
            updates.note_start(str(error))
        else:
            updates.note_start()
            updates.open()


async def _cancelled(task: asyncio.Task[None]) -> None:
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)


async def _leave_all(operators: Sequence[Operator], page: PageServer) -> None:
    """Stop all hands at once: a dead link takes 2 s, in which the others would move on."""
    page.refuse_commands()
    await wait_shielded(asyncio.gather(*map(_leave, operators, page.updates)))


async def _leave(operator: Operator, updates: HandUpdates) -> None:
    words = await operator.leave()
    if not updates.problem:  # no line for a hand that was never reached
        tell(f"{operator.hand.address}: {words}")


def _password(file: Path | None) -> str:
    if file is None:
        return ""
    password = _text(file).partition("\n")[0].strip()
    if len(password) < 8:
        raise UsageError(f"{file}: the first line must be a password of 8 characters or more")
    return password


def _readable(file: Path | None) -> str:
    if file is not None:
        _text(file)
    return "" if file is None else str(file)


def _text(file: Path) -> str:
    try:
        with file_errors(file):
            return file.read_text(encoding="utf-8")
    except UnicodeDecodeError as error:
        raise UsageError(f"{file} is not a text file") from error


def _refuse_doubles(addresses: Sequence[str]) -> None:
    for address in addresses:
        if addresses.count(address) > 1:
            raise UsageError(f"{address} is given twice")
