"""One hand owns a gripper in this process, however its address is written."""

from __future__ import annotations

import asyncio
from pathlib import Path

import pytest

from robotiq_async import ConnectFailedError, InvalidStateError, RobotiqHand, State
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from tests.virtual_line import VirtualLine


@pytest.mark.parametrize(
    "host",
    ["127.0.0.1", "localhost", "LOCALHOST.", "[::1]", "[0:0:0:0:0:0:0:1]", "[::ffff:127.0.0.1]", "0.0.0.0"],
)
async def test_one_gripper_has_one_hand(hand: RobotiqHand, server: SimulatorServer, host: str) -> None:
    writes = len(server.gripper.writes)
    for other in (
        RobotiqHand(f"{host}:{server.port}"),
        RobotiqHand(f"tcp://{host}:{server.port}", device_id=3),
    ):
        with pytest.raises(InvalidStateError, match=r"another hand runs on tcp://127\.0\.0\.1") as caught:
            await other.start()
        assert "gateway" in str(caught.value)
        assert other.state is State.DISCONNECTED
    assert hand.state is State.RUNNING_IDLE
    assert len(server.gripper.writes) == writes


async def test_the_error_says_when_it_is_the_same_hand(hand: RobotiqHand) -> None:
    with pytest.raises(InvalidStateError, match=r"this hand runs on .* already: stop\(\) it first$"):
        await hand.start()


async def test_two_grippers_behind_one_gateway_have_two_hands(server: SimulatorServer) -> None:
    """The simulator answers any unit id, as a gateway does that has a gripper for each."""
    async with RobotiqHand(server.address, device_id=4) as four:
        five = RobotiqHand(server.address, device_id=5)
        await five.start()
        for device_id in (4, 5, None):
            with pytest.raises(InvalidStateError):
                await RobotiqHand(server.address, device_id=device_id).start()
        await five.stop(halt=False)
        assert four.state is State.RUNNING_IDLE


@pytest.mark.virtual_time
async def test_a_serial_port_has_one_hand_unless_both_name_their_units(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    line, link = VirtualLine(monkeypatch), tmp_path / "tty"
    link.symlink_to(line.near)
    gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=20)
    async with (
        SerialSimulatorServer(line.FAR, gripper),
        RobotiqHand(f"rtu://{line.near}", device_id=9) as hand,
    ):
        for port in (line.near, link):
            for unit in (None, 9):
                other = RobotiqHand(f"rtu://{port}", device_id=unit)
                with pytest.raises(InvalidStateError, match="give each of the hands its device_id"):
                    await other.start()
        assert hand.statistics.reconnects == 0


async def test_a_gripper_is_free_again_after_stop_and_after_a_failed_start(server: SimulatorServer) -> None:
    first, second = RobotiqHand(server.address), RobotiqHand(f"localhost:{server.port}")
    await first.start()
    await first.stop()
    await second.start()
    await second.stop()
    await server.stop()
    for hand in (first, second):
        with pytest.raises(ConnectFailedError):
            await hand.start()
    await server.start()
    await first.start()
    await first.stop()
