"""The three tunnels of the page, at simulated arms."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import JAW, ConnectionLostError, RobotiqHand, State
from robotiq_async.link.address import parse_address
from robotiq_async.runtime.clock import now
from tests.arms import CONTROLLERS, SocketController, ToolLine, arm_with_jaw

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize("name", CONTROLLERS)
async def test_it_carries_what_a_serial_line_carries(name: str) -> None:
    async with arm_with_jaw(name) as (there, server, tunnel), RobotiqHand(tunnel, model="2f85") as hand:
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


@pytest.mark.parametrize("delay", [0.0, 0.004])
@pytest.mark.parametrize("name", CONTROLLERS)
async def test_it_is_as_quick_as_a_socket_to_the_same_line(name: str, delay: float) -> None:
    """From the request to the first status that shows it; both programs take as long for a request."""
    calls = 2 if name == "Doosan" else 1
    function = 16 if name == "Dobot" else 23
    async with arm_with_jaw(name, delay) as (_, server, tunnel):
        through = await asked_to_echo(RobotiqHand(tunnel, model="2f85", write_function=function))
        line = ToolLine(parse_address(server.address).port)
        async with SocketController(line, calls * delay) as relay:
            beside = RobotiqHand(f"rtu+tcp://127.0.0.1:{relay.port}", model="2f85", write_function=function)
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
