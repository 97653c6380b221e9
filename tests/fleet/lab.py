"""A gripper, its agent and a client on another host, in one virtual loop."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Any

from robotiq_async import RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire import status_message
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import THREE_FINGER, Model
from tests.fleet.network import MemoryBus, Network
from tests.grippers import activate_beforehand

SPEEDUP = 5.0


@dataclass
class Lab:
    """All there is in one test.

    Attributes:
        gripper: is active.
        local: the agent's hand.
    """

    network: Network
    gripper: SimulatedGripper
    server: SimulatorServer
    local: RobotiqHand
    agent: Agent
    serving: asyncio.Task[None]

    def client(self, name: str = "client", **options: Any) -> RemoteHand:
        """A remote hand that is not started."""
        return RemoteHand("zenoh://lab/cell/left", bus=self.network.bus(name), **options)

    def client_over(self, bus: Any, **options: Any) -> RemoteHand:
        """The same, over a bus of the test's own."""
        return RemoteHand("zenoh://lab/cell/left", bus=bus, **options)

    @property
    def lease(self) -> int:
        """The number of the lease, as every status of the agent tells it."""
        return status_message.unpack(self.agent.hands["left"].publisher.status_message()).lease

    async def end_agent(self) -> None:
        self.serving.cancel()
        await asyncio.gather(self.serving, return_exceptions=True)


@asynccontextmanager
async def lab(
    *,
    window: float = 1.0,
    active: bool = True,
    kind: type[SimulatedGripper] = SimulatedGripper,
    keep_grip: bool = False,
    model: Model = THREE_FINGER,
) -> AsyncIterator[Lab]:
    """An agent that serves zenoh://lab/cell/left, and a network named by the buses "agent" and "client"."""
    loop = asyncio.get_running_loop()
    network = Network()
    gripper = kind(loop.time, speedup=SPEEDUP, device_cycle=0.005 * SPEEDUP, spread=False, model=model)
    async with SimulatorServer(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        hand = RobotiqHand(server.address, keep_grip=keep_grip, model=model)
        agent = Agent("lab", "cell", {"left": hand}, network.bus("agent"), window=window)
        ready = asyncio.Event()
        serving = asyncio.create_task(agent.run(ready.set))
        try:
            await ready.wait()
            yield Lab(network, gripper, server, hand, agent, serving)
        finally:
            serving.cancel()
            await asyncio.gather(serving, return_exceptions=True)


__all__ = ["Lab", "MemoryBus", "lab"]
