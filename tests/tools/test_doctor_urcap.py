"""The doctor's findings at a URCap's text port."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble, UrcapSimulatorServer
from robotiq_async.tools.doctor import Level
from robotiq_async.values.model import HAND_E, TWO_FINGER_85
from tests.grippers import activate_beforehand
from tests.tools.test_doctor import answering, findings

pytestmark = pytest.mark.virtual_time


def jaw() -> SimulatedGripper:
    return SimulatedGripper(asyncio.get_running_loop().time, model=HAND_E)


async def test_a_healthy_one() -> None:
    gripper = jaw()
    async with UrcapSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        found = await findings(server.address)
        assert all(finding.level is Level.GOOD for finding in found.values())
        assert [*found] == [
            *("name", "port", "URCap", "current", "round trip", "rate", "model", "activation", "fault"),
            "other clients",
        ]
        assert found["activation"].found == "active"
        assert len(gripper.writes) == 2, "those of the test"


async def test_nothing_listens() -> None:
    async with UrcapSimulatorServer() as server:
        pass
    found = await findings(server.address)
    assert found["port"].level is Level.BAD
    assert "connection refused" in found["port"].found
    for words in ("Is Robotiq's URCap installed", "rtu+tcp://HOST:54321", "The URCap's port is 63352."):
        assert words in found["port"].advice


async def test_it_does_not_answer() -> None:
    async with UrcapSimulatorServer(jaw()) as server:
        await server.fault_injector.begin(Trouble("silence"))
        found = await findings(server.address)
    assert found["URCap"].level is Level.BAD
    assert "no answer to GET STA within 0.5 s" in found["URCap"].found
    assert "Can the gripper be moved at the teach pendant?" in found["URCap"].advice


async def test_it_answers_half_a_line() -> None:
    async with UrcapSimulatorServer(jaw()) as server:
        await server.fault_injector.begin(Trouble("half", lasts=100))
        found = await findings(server.address)
    assert "half a line, 'STA', answers GET STA" in found["URCap"].found


async def test_it_hangs_up() -> None:
    async with UrcapSimulatorServer(jaw()) as server:
        server.policy = lambda _: None
        found = await findings(server.address)
    assert "It closes the connection when asked" in found["URCap"].advice


async def test_something_else_answers() -> None:
    async with answering(lambda _: b"HTTP/1.1 400 Bad Request\r\n") as address:
        found = await findings(f"urcap://{address}?model=2f85")
    assert found["URCap"].level is Level.BAD
    assert "not the answer to GET STA" in found["URCap"].found
    assert "not the text port" in found["URCap"].advice


async def test_a_modbus_port() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with SimulatorServer(gripper) as server:
        found = await findings(server.address.replace("tcp://", "urcap://"))
    assert found["URCap"].level is Level.BAD


async def test_which_of_several_grippers() -> None:
    gripper = jaw()
    async with UrcapSimulatorServer(gripper, device_id=2) as server:
        await activate_beforehand(gripper)
        assert (await findings(server.address, device_id=2))["gripper id"].found == "2 was chosen"
        found = await findings(server.address, device_id=5)
        assert found["gripper id"].level is Level.BAD
        assert "does not choose gripper 5" in found["gripper id"].found


async def test_a_slow_one() -> None:
    gripper = jaw()
    async with UrcapSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        await server.fault_injector.begin(Trouble("delay", 0.0174))
        found = await findings(server.address)
    assert found["round trip"].level is Level.DOUBT
    assert found["rate"].advice == "Pass poll_interval=0.02."


async def test_another_client() -> None:
    gripper = jaw()
    async with UrcapSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        plan = [Trouble("foreign", position, at=at) for position, at in ((50, 0.9), (200, 1.2), (90, 1.5))]
        running = asyncio.ensure_future(server.fault_injector.run(plan))
        found = await findings(server.address)
        running.cancel()
    assert found["other clients"].level is Level.DOUBT
