"""One hand owns a gripper in this process, however its address is written; another client is noticed."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from pathlib import Path

import pytest

from robotiq_async import (
    ConnectFailedError,
    Fault,
    Finger,
    InvalidStateError,
    MoveSupersededError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer
from robotiq_async.values.request import AxisRequest, Request
from tests.contract.bench import at_rest
from tests.grippers import until_moving
from tests.serial_line import SerialLine

A = Finger.A


class Gateway:
    """Hands each request on to the gripper of its unit id, as a Modbus gateway does."""

    def __init__(self, grippers: dict[int, SimulatorServer]) -> None:
        self._grippers = grippers
        self._server: asyncio.Server

    async def __aenter__(self) -> str:
        self._server = await asyncio.start_server(self._serve, "127.0.0.1", 0)
        return f"127.0.0.1:{self._server.sockets[0].getsockname()[1]}"

    async def __aexit__(self, *_: object) -> None:
        self._server.close()
        await self._server.wait_closed()

    async def _serve(self, reader: asyncio.StreamReader, writer: asyncio.StreamWriter) -> None:
        lines: dict[int, tuple[asyncio.StreamReader, asyncio.StreamWriter]] = {}
        try:
            while True:
                frame = await self._frame(reader)
                if frame[6] not in lines:
                    port = self._grippers[frame[6]].port
                    lines[frame[6]] = await asyncio.open_connection("127.0.0.1", port)
                there, back = lines[frame[6]]
                back.write(frame)
                writer.write(await self._frame(there))
        except asyncio.IncompleteReadError:
            pass
        finally:
            for each in (writer, *(back for _, back in lines.values())):
                each.close()
                await each.wait_closed()

    async def _frame(self, reader: asyncio.StreamReader) -> bytes:
        header = await reader.readexactly(6)
        return header + await reader.readexactly(int.from_bytes(header[4:], "big"))


@pytest.fixture
async def another_server() -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(SimulatedGripper(speedup=20)) as server:
        yield server


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


async def test_this_hand_is_told_that_it_is_this_hand(hand: RobotiqHand) -> None:
    with pytest.raises(InvalidStateError, match=r"this hand runs on .* already: stop\(\) it first$"):
        await hand.start()


async def test_two_grippers_behind_one_gateway_have_two_hands(
    server: SimulatorServer, another_server: SimulatorServer
) -> None:
    async with (
        Gateway({4: server, 5: another_server}) as gateway,
        RobotiqHand(gateway, device_id=4) as four,
        RobotiqHand(gateway, device_id=5) as five,
    ):
        await asyncio.gather(four.move(60, Finger.A), five.move(200, Finger.B))
        assert server.gripper.position(Finger.A) == pytest.approx(60, abs=3)
        assert another_server.gripper.position(Finger.B) == pytest.approx(200, abs=3)
        assert server.gripper.position(Finger.B) < 10 > another_server.gripper.position(Finger.A)
        assert not four.statistics.foreign_commands
        assert not five.statistics.foreign_commands
        for device_id in (4, None):
            with pytest.raises(InvalidStateError):
                await RobotiqHand(gateway, device_id=device_id).start()


async def test_a_serial_port_has_one_hand_whatever_the_unit_id(tmp_path: Path) -> None:
    with SerialLine(tmp_path) as line:
        async with (
            SerialSimulatorServer(line.far, SimulatedGripper(speedup=20)),
            RobotiqHand(f"rtu://{line.near}", device_id=9) as hand,
        ):
            for port in (line.near, line.near.resolve()):
                other = RobotiqHand(f"rtu://{port}", device_id=10)
                with pytest.raises(InvalidStateError, match="a serial port has one owner"):
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


@pytest.mark.virtual_time
async def test_two_hands_on_one_address(hand: RobotiqHand, server: SimulatorServer) -> None:
    for spelled in (server.address, server.address.removeprefix("tcp://"), f"localhost:{server.port}"):
        other = RobotiqHand(spelled)
        with pytest.raises(InvalidStateError):
            await other.start()
    await hand.stop()
    async with RobotiqHand(server.address):
        pass


async def test_another_client_is_noticed(
    hand: RobotiqHand, server: SimulatorServer, caplog: pytest.LogCaptureFixture
) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await until_moving(server, hand)
    image = Request(activate=True, go=True, axes=(AxisRequest(10, 255, 100),) * 4)
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        server.gripper.write(0, image.registers)
        with pytest.raises(MoveSupersededError):
            await moving
    assert hand.statistics.foreign_commands == 1
    assert "another client" in caplog.text
    await at_rest(hand)
    assert server.gripper.position(A) == pytest.approx(10, abs=2)


async def test_a_gripper_found_in_fault_is_not_taken_for_one_that_others_command(
    server: SimulatorServer,
) -> None:
    server.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    async with RobotiqHand(server.address) as hand:
        async for status in hand.statuses():
            if status.sequence > 10:
                break
        assert hand.state is State.FAULT
        assert hand.statistics.foreign_commands == 0
