"""An agent for the code on the pages: it serves what they call zenoh://lab/cell-1/left."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Final

from robotiq_async import RobotiqHand
from robotiq_async.fleet import Agent
from robotiq_async.fleet.network.configuration import agent_configuration
from robotiq_async.fleet.network.route import CONNECT_VARIABLE
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.simulator import SimulatedGripper, SimulatorServer

ROOM: Final = "robotiq_async.fleet"
"""Code that imports of it meets an agent."""


@asynccontextmanager
async def agent_of_the_pages() -> AsyncIterator[dict[str, str]]:
    """Serve a gripper; gives the variables of the environment that lead there."""
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{reserved.getsockname()[1]}"
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        bus = await open_bus(agent_configuration("lab", "cell-1", ["left"], [endpoint]), endpoint)
        agent = Agent("lab", "cell-1", {"left": RobotiqHand(server.address)}, bus)
        ready = asyncio.Event()
        serving = asyncio.create_task(agent.run(ready.set))
        try:
            await ready.wait()
            yield {CONNECT_VARIABLE: endpoint}
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)
            await bus.close()
