"""The simulated gripper on a serial line: a pseudo terminal, and RTU frames made by hand."""

from __future__ import annotations

import asyncio
import os
import struct
from typing import TYPE_CHECKING

import pytest

from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper
from robotiq_async.simulator.server.framing import take_rtu
from robotiq_async.values.status import RobotiqStatus
from tests.serial_line import with_crc

pytest.importorskip("serial")
pty = pytest.importorskip("pty")
tty = pytest.importorskip("tty")

if TYPE_CHECKING:
    from collections.abc import AsyncIterator, Iterator


def test_the_checksum_itself() -> None:
    assert with_crc(b"123456789")[-2:] == (0x4B37).to_bytes(2, "little")


class Line:
    """A pseudo terminal: the simulator opens the port, the test holds the other end."""

    def __init__(self) -> None:
        self.master, self.slave = os.openpty()
        tty.setraw(self.master)
        tty.setraw(self.slave)
        os.set_blocking(self.master, False)
        self.port = os.ttyname(self.slave)

    def send(self, frame: bytes) -> None:
        os.write(self.master, frame)

    async def receive(self, size: int) -> bytes:
        """Exactly this many bytes."""
        loop = asyncio.get_running_loop()
        arrived = asyncio.Event()
        loop.add_reader(self.master, arrived.set)
        data = b""
        try:
            async with asyncio.timeout(5):
                while len(data) < size:
                    arrived.clear()
                    await arrived.wait()
                    data += os.read(self.master, size - len(data))
        finally:
            loop.remove_reader(self.master)
        return data

    async def ask(self, pdu: bytes, answer_size: int, unit: int = 9) -> bytes:
        """The PDU that answers, checked."""
        self.send(with_crc(bytes([unit]) + pdu))
        answer = await self.receive(1 + answer_size + 2)
        assert answer == with_crc(answer[:-2])
        assert answer[0] == unit
        return answer[1:-2]

    async def read_status(self) -> RobotiqStatus:
        answer = await self.ask(bytes.fromhex("03 07d0 0008"), 18)
        assert answer[:2] == b"\x03\x10"
        return RobotiqStatus.from_registers(struct.unpack(">8H", answer[2:]))

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()


@pytest.fixture
async def server(line: Line) -> AsyncIterator[SerialSimulatorServer]:
    async with SerialSimulatorServer(line.port, SimulatedGripper(speedup=100.0)) as server:
        yield server


async def test_activation(server: SerialSimulatorServer, line: Line) -> None:
    write = bytes.fromhex("10 03e8 0008 10 0100 0000 0000 0000 0000 0000 0000 0000")
    assert await line.ask(write, 5) == bytes.fromhex("10 03e8 0008")
    while not (await line.read_status()).is_activated:
        pass
    assert server.gripper.request_registers[0] == 0x0100


async def test_partial_write_and_read_back(server: SerialSimulatorServer, line: Line) -> None:
    assert await line.ask(bytes.fromhex("10 03ea 0002 04 aaaa bbbb"), 5) == bytes.fromhex("10 03ea 0002")
    assert await line.ask(bytes.fromhex("06 03eb 1234"), 5) == bytes.fromhex("06 03eb 1234")
    assert await line.ask(bytes.fromhex("03 03ea 0002"), 6) == bytes.fromhex("03 04 aaaa 1234")


async def test_reading_and_writing_at_once(server: SerialSimulatorServer, line: Line) -> None:
    """The manual's example of function 23, but for the checksum it prints under the request."""
    server.gripper.device_cycle = (
        5.0  # on a busy machine the read comes late, and is to come before the effect
    )
    request = bytes.fromhex("17 07d0 0002 03e9 0002 04 00e6 3cc8")
    assert with_crc(b"\x09" + bytes.fromhex("17 04 e000 0000"))[-2:] == bytes.fromhex("4727"), "as printed"
    assert await line.ask(request, 6) == bytes.fromhex("17 04 0000 0000")
    assert server.gripper.request_registers == (0, 0x00E6, 0x3CC8, 0, 0, 0, 0, 0)


async def test_what_is_written_comes_before_what_is_read(server: SerialSimulatorServer, line: Line) -> None:
    for value in (b"\x12\x34", b"\x56\x78"):
        request = bytes.fromhex("17 03e9 0001 03e9 0001 02") + value
        assert await line.ask(request, 4) == bytes.fromhex("17 02") + value


@pytest.mark.parametrize(
    "request_",
    [
        *("09 03 07d0 0008", "09 06 03e8 0100", "09 10 03e8 0001 02 0100"),
        "09 17 07d0 0001 03e8 0001 02 0100",
    ],
)
def test_a_request_in_single_bytes(request_: str) -> None:
    whole = with_crc(bytes.fromhex(request_))
    inbox = bytearray()
    frames = []
    for byte in whole:
        inbox.append(byte)
        frames.append(take_rtu(inbox))
    assert frames[:-1] == [None] * (len(whole) - 1)
    assert frames[-1] == (9, 0, whole[1:-2])
    assert not inbox


async def test_life(line: Line) -> None:
    server = SerialSimulatorServer(line.port)
    assert server.address == f"rtu://{line.port}"
    await server.start()
    with pytest.raises(RuntimeError, match="running already"):
        await server.start()
    await server.stop()
    await server.stop()
    await server.start()
    assert (await line.read_status()).is_reset
    await server.stop()


async def test_a_port_that_does_not_exist() -> None:
    server = SerialSimulatorServer("/dev/no-such-port")
    with pytest.raises(OSError, match="no-such-port"):
        await server.start()
    assert not server.is_running


async def test_without_pyserial(line: Line, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("importlib.util.find_spec", lambda _: None)
    with pytest.raises(ImportError, match=r"needs pyserial: pip install .*the extra serial"):
        await SerialSimulatorServer(line.port).start()
