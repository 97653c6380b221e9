"""Drivers of others, and the manual's frames, which drive real two-finger grippers, on a simulated one."""

from __future__ import annotations

import asyncio
import struct
from collections.abc import AsyncIterator
from pathlib import Path

import minimalmodbus
import pytest
import serial
from pyrobotiqgripper import RobotiqGripper

from robotiq_async import JAW, TWO_FINGER_85, RobotiqStatus
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SerialSimulatorServer, SimulatedGripper
from robotiq_async.simulator.troubles.like_hardware import like_hardware, own_habits
from tests.patience import patience
from tests.serial_line import SerialLine, with_crc


@pytest.fixture
def gripper() -> SimulatedGripper:
    return SimulatedGripper(speedup=20, spread=False, model=TWO_FINGER_85)


@pytest.fixture
async def port(gripper: SimulatedGripper, tmp_path: Path) -> AsyncIterator[str]:
    with SerialLine(tmp_path) as line:
        async with SerialSimulatorServer(line.far, gripper):
            yield str(line.near)


def use(driver: RobotiqGripper) -> list[tuple[int, int, float]]:
    """Activate, close, open; the object status, the reading and the stroke left, each time."""
    driver.activate()
    driver.calibrate_mm(closemm=0, openmm=85)  # moves to both ends
    seen = []
    for position in (255, 0):
        driver.move(position, speed=255, force=100)
        seen.append((driver.objectDetection(), driver.position(), driver.position_mm()))
    driver.disconnect()
    return seen


async def test_pyrobotiqgripper_on_a_serial_line(gripper: SimulatedGripper, port: str) -> None:
    seen = await asyncio.to_thread(lambda: use(RobotiqGripper(com_port=port)))
    assert [(status, position) for status, position, _ in seen] == [(3, 230), (3, 3)]
    assert [millimetres for *_, millimetres in seen] == pytest.approx([0, 85], abs=0.5)


async def test_pyrobotiqgripper_grips_a_part_through_the_port_of_a_tool(gripper: SimulatedGripper) -> None:
    """RTU through a TCP socket, as an arm's tool port passes it on; writes and reads are function 23."""

    def grip(port: int) -> tuple[int, int]:
        driver = RobotiqGripper(connection_type="RTU_VIA_TCP", tcp_port=port)
        driver.activate()
        gripper.place_object(JAW, 120)
        driver.close(speed=255, force=100)
        found = driver.objectDetection(), driver.position()
        driver.disconnect()
        return found

    async with RtuOverTcpSimulatorServer(gripper) as server:
        status, position = await asyncio.to_thread(grip, server.port)
    assert (status, position) == (2, pytest.approx(126, abs=5)), "at full speed it runs on by six counts"


async def test_pyrobotiqgripper_on_a_jaw_like_hardware() -> None:
    """It gives up an activation after 5 s; with the habits of a 3-Finger, of 12 s, it always did."""
    jaw = SimulatedGripper(speedup=2, spread=False, model=TWO_FINGER_85, habits=own_habits(TWO_FINGER_85))
    async with RtuOverTcpSimulatorServer(jaw) as server:
        for habit in like_hardware(TWO_FINGER_85):
            await server.fault_injector.begin(habit)

        def grip() -> tuple[bool, int]:
            driver = RobotiqGripper(connection_type="RTU_VIA_TCP", tcp_port=server.port)
            driver.activate()
            driver.move(120, speed=255, force=100)
            found = driver.isActivated(), driver.position()
            driver.disconnect()
            return found

        assert await asyncio.to_thread(grip) == (True, pytest.approx(120, abs=3))


async def test_a_loop_that_writes_and_reads_with_function_23_sees_its_own_request() -> None:
    """The vendor's example: write, and read until gOBJ reports the end of the motion."""
    jaw = SimulatedGripper(speedup=10, spread=False, model=TWO_FINGER_85)
    async with RtuOverTcpSimulatorServer(jaw) as server:
        for habit in like_hardware(TWO_FINGER_85):
            await server.fault_injector.begin(habit)
        reader, writer = await asyncio.open_connection("127.0.0.1", server.port)

        async def exchange(*image: int) -> RobotiqStatus:
            request = struct.pack(">BBHHHHB3H", 9, 23, 2000, 3, 1000, 3, 6, *image)
            writer.write(with_crc(request))
            reply = await reader.readexactly(3 + 6 + 2)
            words = struct.unpack(">3H", reply[3:9])
            return RobotiqStatus((*words, 0, 0, 0, 0, 0), model=TWO_FINGER_85)

        while not (await exchange(0x0100, 0, 0)).is_activated:
            pass
        while (status := await exchange(0x0900, 200, 0xFFFF)).is_moving:
            assert status.requested_position(JAW) == 200, "each reply shows the request that it answers"
        assert abs(status.position(JAW) - 200) <= 2
        writer.close()
        await writer.wait_closed()


async def test_minimalmodbus(gripper: SimulatedGripper, port: str) -> None:
    """Register by register: what scripts without a driver do."""

    def grip() -> RobotiqStatus:
        driver = minimalmodbus.Instrument(port, 9)
        driver.serial.baudrate, driver.serial.timeout = 115200, 0.2

        def status() -> RobotiqStatus:
            return RobotiqStatus((*driver.read_registers(2000, 3), 0, 0, 0, 0, 0), model=TWO_FINGER_85)

        driver.write_registers(1000, [0, 0, 0])
        driver.write_registers(1000, [0x0100, 0, 0])
        while not status().is_activated:
            pass
        gripper.place_object(JAW, 120)
        driver.write_registers(1000, [0x0900, 255, 0xFF40])
        while status().requested_position(JAW) != 255 or status().is_moving:
            pass
        held = status()
        driver.serial.close()
        return held

    assert (await asyncio.to_thread(grip)).contacts == JAW


RESET = "09 10 03 E8 00 03 06 00 00 00 00 00 00 73 30"
ACTIVATE = "09 10 03 E8 00 03 06 01 00 00 00 00 00 72 E1"
CLOSE = "09 10 03 E8 00 03 06 09 00 00 FF FF FF 42 29"
OPEN = "09 10 03 E8 00 03 06 09 00 00 00 FF FF 72 19"
WRITTEN = "09 10 03 E8 00 03 01 30"
READ_ONE, ACTIVATING, ACTIVE = "09 03 07 D0 00 01 85 CF", "09 03 02 11 00 55 D5", "09 03 02 31 00 4C 15"
READ_THREE = "09 03 07 D0 00 03 04 0E"
CLOSING, HELD = "09 03 06 39 00 00 FF", "09 03 06 B9 00 00 FF"
OPENING, OPENED = "09 03 06 39 00 00 00", "09 03 06 F9 00 00 00"


async def test_the_frames_of_the_manual(tmp_path: Path) -> None:
    """Manual of the 2F-85 and 2F-140, a grasp over RTU: the requests, and the replies that it prints.

    Position and current, the last two bytes of a status, depend on the part. Time passes with the exchanges:
    a busy machine sees each motion, too.
    """
    moment = 0.0
    gripper = SimulatedGripper(lambda: moment, speedup=20, spread=False, model=TWO_FINGER_85)

    def play(port: Path) -> None:
        with serial.Serial(str(port), 115200, timeout=patience(2)) as line:

            def replied(request: str, size: int) -> str:
                nonlocal moment
                line.write(bytes.fromhex(request))
                reply = str(line.read(size).hex(" ").upper())
                moment += 0.005
                return reply

            assert replied(RESET, 8) == WRITTEN
            assert replied(ACTIVATE, 8) == WRITTEN
            assert replied(READ_ONE, 7) == ACTIVATING
            while (reply := replied(READ_ONE, 7)) == ACTIVATING:
                pass
            assert reply == ACTIVE
            gripper.place_object(JAW, 0xBD)
            for request, moving, ended in ((CLOSE, CLOSING, HELD), (OPEN, OPENING, OPENED)):
                assert replied(request, 8) == WRITTEN
                seen = {replied(READ_THREE, 11)[: len(moving)]}
                while ended not in seen:
                    seen.add(replied(READ_THREE, 11)[: len(moving)])
                assert moving in seen

    with SerialLine(tmp_path) as line:
        async with SerialSimulatorServer(line.far, gripper), asyncio.timeout(patience(10)):
            await asyncio.to_thread(play, line.near)
