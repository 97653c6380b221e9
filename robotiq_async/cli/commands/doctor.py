"""``robotiq-async doctor``."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ...link.address import parse_address
from ..arguments import Address, Unit
from ..failures import CommandError, usage

if TYPE_CHECKING:
    from ...doctor import Finding


async def doctor(
    address: Address = "sim://",
    /,
    *,
    device_id: Unit | None = None,
) -> None:
    """Find out what is wrong with a connection. Nothing moves and nothing is written.

    Name, port, Modbus, unit id, register addresses, round trip and rate, activation,
    fault, other clients: one line each, with what to do about it. It takes some
    seconds. Exits with 1 when something is broken.

    For example:

        robotiq-async doctor tcp://192.168.1.11
        robotiq-async doctor rtu:///dev/ttyUSB0

    Args:
        device_id: Modbus unit id (default: 2 over TCP, 9 over a serial line).
    """
    from ...doctor import Level, examine

    with usage():
        parsed = parse_address(address)
    bad: list[str] = []

    def report(finding: Finding) -> None:
        print(f"{finding.level.value:<5} {finding.what:<14} {finding.found}", flush=True)
        if finding.advice:
            print(f"{'':<20} {finding.advice}", flush=True)
        if finding.level is Level.BAD:
            bad.append(finding.what)

    await examine(parsed, report, device_id=device_id)
    if bad:
        raise CommandError(f"{parsed}: {', '.join(bad)}: see above")
