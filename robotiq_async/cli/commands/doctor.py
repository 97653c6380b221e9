"""``robotiq-async doctor``."""

from __future__ import annotations

import shutil
import sys
import textwrap
from typing import TYPE_CHECKING

from ...hands import HandOptions
from ...link import is_remote, parse_address, registers_of
from ...runtime import printable
from ..addresses import full_address, gripper_words
from ..arguments import AddressArgument, Unit, need
from ..failures import CommandError, UsageError, usage

if TYPE_CHECKING:
    from ...tools.doctor import Finding


async def doctor(
    address: AddressArgument,
    /,
    *,
    device_id: Unit | None = None,
) -> None:
    """Find the fault of a connection. Nothing moves and nothing is written.

    Name, port, Modbus or URCap, unit id, register addresses, round trip and rate, activation,
    fault, other clients: one line each, with advice. For a gripper on another host:
    certificates, port, agent, access, round trip, statuses, the gripper, and who commands
    it. It takes some seconds. Exits with 1 when something is broken.

    For example:

        robotiq-async doctor tcp://192.168.1.11
        robotiq-async doctor rtu:///dev/ttyUSB0
        robotiq-async doctor rtu+tcp://192.168.1.20:54321
        robotiq-async doctor "urcap://192.168.1.20?model=2f85"
        robotiq-async doctor "zenoh://lab/cell-1/left?connect=tls/192.168.1.20:7447"

    Args:
        device_id: Modbus unit id (default: 2 over TCP, 9 over a serial line, a URCap's own).
    """
    from ...tools.doctor import Level, examine, examine_remote

    full = full_address(address)
    bad: list[str] = []

    def report(finding: Finding) -> None:
        mark = f"{finding.level.value:<5} {finding.what:<14} "
        for words in filter(None, (finding.found, finding.advice)):
            print(_hung(mark, printable(words)), flush=True)
            mark = " " * len(mark)
        if finding.level is Level.BAD:
            bad.append(finding.what)

    if is_remote(address):
        need("zenoh", "fleet")
        need("cryptography", "fleet")
        if device_id is not None:
            raise UsageError("a gripper on another host is set up there: its agent's file has device_id")
    else:
        with usage():
            parsed = parse_address(address)
            registers_of(parsed, device_id=device_id)
            if parsed.kind != "sim":
                HandOptions(address, device_id=device_id)  # raises as a hand would
    print(gripper_words(address), flush=True)
    if is_remote(address):
        await examine_remote(address, report)
    else:
        try:
            await examine(parse_address(address), report, device_id=device_id)
        except ImportError as error:  # the extra of a simulation with physics
            raise CommandError(str(error)) from error
    if bad:
        raise CommandError(f"{full}: {', '.join(bad)}: see above")


def _hung(mark: str, words: str) -> str:
    """Words after a mark: in lines of the terminal, below each other; a line for anything else that reads."""
    if not sys.stdout.isatty():
        return mark + words
    width, indent = shutil.get_terminal_size().columns, " " * len(mark)
    return textwrap.fill(words, width, initial_indent=mark, subsequent_indent=indent, break_on_hyphens=False)
