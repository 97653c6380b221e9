"""``robotiq-async agent``."""

from __future__ import annotations

import asyncio
import sys
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

from cyclopts import Parameter

from ...runtime import log
from ..addresses import gripper_words, is_simulated
from ..arguments import Flag, need
from ..failures import UsageError
from ..output.messages import forget, forwarded_warnings, tell

if TYPE_CHECKING:
    from ...fleet.agent.agent import Agent
    from ...fleet.network.zenoh_bus import ZenohBus
    from ..agent_file import AgentSettings

WAITING_S = 2.0
"""Seconds until it reports that it waits for a router; usually a session opens in a tenth of this time."""


async def agent(
    file: Annotated[Path, Parameter(metavar="FLEET.toml")],
    /,
    *,
    check: Flag = False,
) -> None:
    """Serve the grippers of this host to other hosts, until Ctrl-C or SIGTERM.

    FLEET.toml names the site, and each gripper with its address:

        site = "lab"
        [grippers.left]
        address = "tcp://192.168.1.11"

    Other programs then use zenoh://SITE/HOST/left as its address, on this machine, and
    on others once there are keys (robotiq-async fleet keys). The addresses are printed
    on standard output when the agent listens, one a line.

    A client that commands a gripper holds a lease. WHEN A LEASE ENDS, AND WHEN THE AGENT
    STARTS, AXES THAT STILL MOVE ARE HELD. When the agent ends, the fingers stop; when it is
    killed, nothing stops them. It is no safety function.

    A gripper that cannot be reached is tried again every second.

    For example:

        robotiq-async agent FLEET.toml
        robotiq-async agent --check FLEET.toml

    Args:
        file: The site's name, and the grippers.
        check: Check the file, print the hands that it serves, and end.
    """
    settings = _settings(file)
    if not check:
        need("zenoh", "fleet")
        await _serve(settings)
    else:
        for name, gripper in settings.grippers.items():
            print(f"zenoh://{settings.site}/{settings.host}/{name}  {gripper.address}")


def _settings(file: Path) -> AgentSettings:
    from ..agent_file import AgentFileError, read_agent_file

    try:
        return read_agent_file(file)
    except AgentFileError as error:
        raise UsageError(str(error)) from None


async def _serve(settings: AgentSettings) -> None:
    from ...fleet.agent.agent import Agent
    from ...fleet.agent.records import file_records
    from ...fleet.network.configuration import agent_configuration
    from ..connect import make_served

    site, host = settings.site, settings.host
    configuration = agent_configuration(
        site,
        host,
        settings.grippers,
        settings.listen,
        settings.connect,
        keys=settings.keys,
        insecure=settings.insecure,
        trusts_router=settings.trusts_router,
    )
    if settings.insecure:
        tell("anyone who reaches this host can command its grippers: there are no keys")
    if settings.keys is not None and settings.connect and not settings.trusts_router:
        tell("clients that come through a router are refused: FLEET.toml has no trusts_router = true")
    hands = {name: make_served(options) for name, options in settings.grippers.items()}
    try:
        bus = await _open(configuration, ", ".join(settings.listen or settings.connect))
        try:
            with forwarded_warnings(tell):
                served = Agent(site, host, hands, bus, window=settings.window, records=file_records())
                await served.run(lambda: _announce(served, settings))
        finally:
            await bus.close()
    except asyncio.CancelledError:
        log.info("the agent ends")  # the normal end of this command


async def _open(configuration: dict[str, object], where: str) -> ZenohBus:
    from ...fleet.network.zenoh_bus import open_bus

    saying = asyncio.get_running_loop().call_later(WAITING_S, tell, f"{where} is not there yet: waiting")
    try:
        return await open_bus(configuration, where)
    finally:
        saying.cancel()


def _announce(served: Agent, settings: AgentSettings) -> None:
    for name, gripper in settings.grippers.items():
        if is_simulated(address := str(gripper.address)):
            tell(f"{name}: {gripper_words(address)}")
    try:
        for each in served.hands.values():
            print(each.name, flush=True)
    except BrokenPipeError:  # the reader has gone; the agent still serves
        forget(sys.stdout)
