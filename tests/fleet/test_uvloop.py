"""Agent and client in uvloop, over zenoh: its clock and its wake-ups are others."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.network.configuration import agent_configuration, client_configuration
from robotiq_async.fleet.network.zenoh_bus import open_bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fleet.sessions import PATIENCE, free_port

uvloop = pytest.importorskip("uvloop")


async def moved() -> None:
    endpoint = f"tcp/127.0.0.1:{free_port()}"
    async with SimulatorServer(SimulatedGripper(speedup=20, spread=False)) as server:
        serving = await open_bus(agent_configuration("lab", "cell", [endpoint]), endpoint)
        agent = asyncio.ensure_future(
            Agent("lab", "cell", {"left": RobotiqHand(server.address)}, serving).run()
        )
        asking = await open_bus(client_configuration([endpoint]), endpoint)
        async with RemoteHand("zenoh://lab/cell/left", bus=asking) as hand:
            result = await hand.move(80, Finger.A, speed=255)
            assert result.positions[Finger.A] == pytest.approx(80, abs=2)
            first = await anext(statuses := hand.statuses(1000))
            for position in range(80, 120):
                hand.command(Finger.A, position=position)
                await asyncio.sleep(0.005)
            await hand.halt()
            assert not hand.is_moving
            assert hand.is_in_control
            times = [first.timestamp, *(status.timestamp for status in statuses.drain())]
            assert times == sorted(times)
            assert len(times) > 5
        agent.cancel()
        await asyncio.gather(agent, return_exceptions=True)
        for bus in (asking, serving):
            await bus.close()


def test_a_hand_moves_and_halts() -> None:
    async def main() -> None:
        async with asyncio.timeout(3 * PATIENCE):
            await moved()

    uvloop.run(main())
