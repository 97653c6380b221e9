"""The three tunnels of the page, at simulated arms."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from robotiq_async import JAW, ConnectionLostError, RobotiqHand, State, Tunnel
from robotiq_async.link.address import parse_address
from robotiq_async.runtime.clock import now
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SimulatedGripper
from robotiq_async.values.model import TWO_FINGER_85
from tests.arms import Arm, DobotController, DoosanController, ToolLine, XArmController, tunnel_of
from tests.grippers import activate_beforehand

pytestmark = pytest.mark.virtual_time

CONTROLLERS: dict[str, type[Arm]] = {
    "XArm": XArmController,
    "Dobot": DobotController,
    "Doosan": DoosanController,
}


@asynccontextmanager
async def arm(name: str, delay: float = 0.0) -> AsyncIterator[tuple[Arm, RtuOverTcpSimulatorServer, Tunnel]]:
    """An arm with a jaw at its tool, which is active, and the tunnel to it."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85, spread=False)
    await activate_beforehand(gripper)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        line = ToolLine(parse_address(server.address).port)
        async with CONTROLLERS[name](line, delay) as there:
            yield there, server, tunnel_of(name, "127.0.0.1", there.port)


@pytest.mark.parametrize("name", CONTROLLERS)
async def test_it_carries_what_a_serial_line_carries(name: str) -> None:
    async with arm(name) as (there, server, tunnel), RobotiqHand(tunnel, model="2f85") as hand:
        server.gripper.place_object(JAW, 150)
        assert await hand.grasp()
        await hand.open()
        assert hand.statistics.reconnects == 0
        # The arm says itself that the gripper is silent.
        there.has_power = False
        with pytest.raises(ConnectionLostError):
            await hand.move(100)
        await hand.wait_for_state(State.DISCONNECTED)
        there.has_power = True
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        # The connection to the arm is lost, and the tunnel opened again.
        there.drop_clients()
        await hand.wait_for_state(State.DISCONNECTED)
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
        await hand.move(100)
        assert server.gripper.position(JAW) == pytest.approx(100, abs=2)


@pytest.mark.parametrize("name", CONTROLLERS)
async def test_it_is_as_quick_as_the_same_line_behind_a_socket(name: str) -> None:
    """From the request to the first status that shows it; the arm takes 4 ms for each call."""
    delay, calls = 0.004, 2 if name == "Doosan" else 1
    async with arm(name, delay) as (_, server, tunnel):
        function = 16 if name == "Dobot" else 23
        through = await asked_to_echo(RobotiqHand(tunnel, model="2f85", write_function=function))
        beside = RobotiqHand(server.address, model="2f85", write_function=function)
        server.reply_silence += calls * delay
        as_usual = await asked_to_echo(beside)
    assert through < 1.1 * as_usual, f"{through} s, not {as_usual}"


async def asked_to_echo(hand: RobotiqHand, rounds: int = 40) -> float:
    """The median, in seconds."""
    times = []
    async with hand:
        statuses = hand.statuses(1000)
        for number in range(rounds):
            await asyncio.sleep(0.02 + 0.0007 * number)
            statuses.drain()
            asked, position = now(), 10 + number
            hand.command(position=position)
            async for status in statuses:
                if status.requested_position(JAW) == position:
                    break
            times.append(now() - asked)
    return sorted(times)[rounds // 2]
