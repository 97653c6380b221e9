"""The hand at a serial server: RTU frames in a TCP socket, in virtual time."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, InvalidStateError, RobotiqHand, State
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SimulatedGripper, Trouble
from tests.grippers import activate_beforehand

pytestmark = pytest.mark.virtual_time

A = Finger.A


async def test_a_move_through_a_serial_server() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server, RobotiqHand(server.address) as hand:
        result = await hand.move(200)
        assert result.positions[A] == pytest.approx(200, abs=2)
        assert hand.statistics.reconnects == 0
        assert hand.statistics.period_p50 == pytest.approx(0.005, abs=1e-6)


@pytest.mark.parametrize("words", ["reset", "close", "accept-silence", "refuse", "silence", "wrong-checksum"])
async def test_it_comes_back(words: str) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        await activate_beforehand(gripper)
        async with RobotiqHand(server.address) as hand:
            lasting = {} if words in ("reset", "close") else {"lasts": 3.0}
            ongoing = await server.fault_injector.begin(Trouble(words, **lasting))  # type: ignore[arg-type]
            await hand.wait_for_state(State.DISCONNECTED, timeout=5)
            await server.fault_injector.end(ongoing)
            await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
            await hand.move(100, A)


@pytest.mark.parametrize("units", [(None, None), (9, None), (None, 12)])
async def test_a_serial_server_has_one_owner_unless_both_name_their_units(
    units: tuple[int | None, int | None],
) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        one = RobotiqHand(server.address, device_id=units[0])
        await one.start(activate=False)
        with pytest.raises(InvalidStateError, match="give each of the hands its device_id"):
            await RobotiqHand(server.address, device_id=units[1]).start(activate=False)
        await one.stop()


async def test_a_socket_carries_one_protocol() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with RtuOverTcpSimulatorServer(gripper) as server:
        one = RobotiqHand(server.address, device_id=9)
        await one.start(activate=False)
        with pytest.raises(InvalidStateError):
            await RobotiqHand(server.address.removeprefix("rtu+"), device_id=12).start(activate=False)
        await one.stop()
