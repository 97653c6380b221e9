"""A gripper that the agent of another host serves: the way to it, the agent, and what the agent says.

Nothing moves, and no lease is taken.
"""

from __future__ import annotations

import asyncio
from datetime import UTC, datetime
from typing import Final

from ...fleet.network.bus import Bus
from ...fleet.network.route import Route, parse_remote_address
from ...fleet.wire.names import ROOT, GripperName
from ...values.errors import ConnectFailedError
from .agent import examine_agent
from .certificates import examine_keys
from .endpoints import examine_way
from .findings import Finding, GiveUpError, Level, Report

LOOK_S: Final = 3.0
"""How long to look for the agent."""
ROUND_S: Final = 0.3
"""Duration of one look."""


async def examine_remote(address: str, report: Report, *, bus: Bus | None = None) -> None:
    """Examine the way to a gripper on another host; reports each finding at once.

    Args:
        address: ``zenoh://SITE/HOST/GRIPPER``, with the route.
        report: called with each finding.
        bus: an open session, which stays open and is not examined; None opens one.

    Raises:
        TypeError, ValueError: a malformed address.
    """
    name, route = parse_remote_address(address)
    way = "a session that is open" if bus is not None else ", ".join(route.endpoints)
    report(Finding(Level.GOOD, "address", f"{name} by {way}"))
    try:
        if bus is not None:
            await _examine(name, bus, report)
        else:
            await _examine_way_and_agent(name, route, report)
    except GiveUpError:
        pass


async def _examine_way_and_agent(name: GripperName, route: Route, report: Report) -> None:
    from ...fleet.network.zenoh_bus import open_bus  # noqa: PLC0415  # needs the extra

    if route.keys is not None:
        examine_keys(route.keys, report, now=datetime.now(UTC))
    try:
        configuration = route.configuration()
    except ValueError as error:
        advice = "robotiq-async fleet keys makes keys; &insecure=1 is for a network of your own."
        report(Finding(Level.BAD, "way", str(error), advice))
        raise GiveUpError from error
    await examine_way(route, report)
    try:
        bus = await open_bus(configuration, str(name))
    except ConnectFailedError as error:
        report(Finding(Level.BAD, "session", str(error), "Are the files in the folder of keys whole?"))
        raise GiveUpError from error
    try:
        await _examine(name, bus, report)
    finally:
        await bus.close()


async def _examine(name: GripperName, bus: Bus, report: Report) -> None:
    await _find(name, bus, report)
    await examine_agent(name, bus, report)


async def _find(name: GripperName, bus: Bus, report: Report) -> None:
    loop = asyncio.get_running_loop()
    ends = loop.time() + LOOK_S
    own: set[str] = set()
    others: set[GripperName] = set()
    while not own and loop.time() < ends:
        for key in await bus.announced(f"{ROOT}/*/*/*/alive/*", timeout=ROUND_S):
            other = GripperName.of_key(key)
            if other == name:
                own.add(key)
            else:
                others.add(other)
        if not own:
            await asyncio.sleep(ROUND_S / 3)
    if not own:
        found = f"no agent serves {name}"
        if others:
            found += f"; there are {', '.join(map(str, sorted(others)))}"
            advice = "Check the three names in the address."
        else:
            advice = (
                "Does robotiq-async agent run there? Is what listens there one? With keys: is this client in "
                "the agent's access.toml, and was the agent started since?"
            )
        report(Finding(Level.BAD, "agent", found, advice))
        raise GiveUpError
    if len(own) > 1:
        advice = "Two agents command one gripper against each other: stop one."
        report(Finding(Level.BAD, "agent", f"{len(own)} serve this gripper", advice))
    else:
        report(Finding(Level.GOOD, "agent", "one serves this gripper"))
