"""A line that several grippers share: each hears the requests to others, and their replies."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    Trouble,
)
from robotiq_async.simulator.server.framing import begins_with_frame, take_rtu
from robotiq_async.values.enums import JAW, Finger
from robotiq_async.values.model import TWO_FINGER_85
from tests.serial_line import with_crc

WRITE_TO_12 = with_crc(bytes.fromhex("0c10 03e8 0003 06 0900 00ff ffff"))
ACKNOWLEDGED = with_crc(bytes.fromhex("0c10 03e8 0003"))
READ_OF_12 = with_crc(bytes.fromhex("0c03 07d0 0003"))
ANSWERED = with_crc(bytes.fromhex("0c03 06 f900 00ff e600"))
BOTH_OF_12 = with_crc(bytes.fromhex("0c17 07d0 0003 03e8 0003 06 0900 00ff ffff"))
REFUSED = with_crc(bytes.fromhex("0c83 02"))
MINE = with_crc(bytes.fromhex("0903 07d0 0003"))


@pytest.mark.parametrize(
    "before",
    [
        (),
        (WRITE_TO_12, ACKNOWLEDGED),
        (READ_OF_12, ANSWERED),
        (BOTH_OF_12, ANSWERED),
        (READ_OF_12, REFUSED),
        (WRITE_TO_12, ACKNOWLEDGED, READ_OF_12, ANSWERED),
    ],
)
def test_what_is_between_others_is_left_out(before: tuple[bytes, ...]) -> None:
    inbox = bytearray(b"".join(before) + MINE)
    assert take_rtu(inbox, 9) == (9, 0, MINE[1:-2])
    assert not inbox


def test_a_frame_of_others_in_single_bytes() -> None:
    inbox = bytearray()
    for byte in WRITE_TO_12 + ACKNOWLEDGED:
        inbox.append(byte)
        assert take_rtu(inbox, 9) is None
    inbox += MINE
    assert take_rtu(inbox, 9) is not None


def test_what_has_no_checksum_is_dropped() -> None:
    inbox = bytearray(ANSWERED[:-1] + b"\x00")
    assert take_rtu(inbox, 9) is None
    assert not inbox
    assert begins_with_frame(ANSWERED, 9)
    assert not begins_with_frame(ANSWERED[:-1] + b"\x00", 9)
    assert begins_with_frame(MINE, 9)


@pytest.fixture
async def line() -> AsyncIterator[RtuOverTcpSimulatorServer]:
    clock = asyncio.get_running_loop().time
    jaw, hand = SimulatedGripper(clock, speedup=10, model=TWO_FINGER_85), SimulatedGripper(clock, speedup=10)
    async with RtuOverTcpSimulatorServer(jaw, others={12: hand}) as server:
        yield server


@pytest.mark.virtual_time
async def test_two_grippers_of_different_models_at_one_port(line: RtuOverTcpSimulatorServer) -> None:
    other = line.others[12]
    async with (
        RobotiqHand(line.address, device_id=9) as jaw,
        RobotiqHand(line.address.partition("?")[0], device_id=12) as hand,
    ):
        closed, _ = await asyncio.gather(jaw.close(), hand.move(150, Finger.ABC))
        assert closed.positions[JAW] >= 224
        assert other.gripper.position(Finger.B) == pytest.approx(150, abs=2)
        assert line.gripper.position(JAW) >= 224
        assert jaw.statistics.reconnects == hand.statistics.reconnects == 0
        async with other.fault_injector.making(Trouble("fault", 13)):
            await asyncio.sleep(0.2)
            assert hand.status.fault
            assert not jaw.status.fault, "each has troubles of its own"
    assert not line.gripper.is_moving


@pytest.mark.virtual_time
async def test_back_to_back_each_is_answered(line: RtuOverTcpSimulatorServer) -> None:
    """A client that sends as soon as a reply is there, to one and the other in turn."""
    reader, writer = await asyncio.open_connection("127.0.0.1", line.port)
    for _ in range(50):
        for unit, size in ((9, 11), (12, 21)):
            count = (size - 5) // 2
            writer.write(with_crc(bytes((unit, 3, 0x07, 0xD0, 0, count))))
            reply = await asyncio.wait_for(reader.readexactly(size), 1.0)
            assert reply[0] == unit
    writer.close()
    await writer.wait_closed()


def test_each_needs_a_different_unit_id() -> None:
    with pytest.raises(ValueError, match="a different unit id, got 9 twice"):
        RtuOverTcpSimulatorServer(others={9: SimulatedGripper()})
    with pytest.raises(ValueError, match=r"a unit id of others must be in 1\.\.247, got 0"):
        SerialSimulatorServer("/dev/ttyFAR", others={0: SimulatedGripper()})
