"""The simulated gripper on a serial line: a pseudo terminal, and RTU frames made by hand."""

from __future__ import annotations

import asyncio
import os
from typing import TYPE_CHECKING

import pytest

from robotiq_async.simulator import SerialSimulatorServer
from robotiq_async.simulator.server.framing import take_rtu
from tests.patience import patience
from tests.serial_line import with_crc
from tests.simulator.test_serial_frames import READ, RESET_READING

pytest.importorskip("serial")
pty = pytest.importorskip("pty")
tty = pytest.importorskip("tty")

if TYPE_CHECKING:
    from collections.abc import Iterator


def test_the_checksum_itself() -> None:
    assert with_crc(b"123456789")[-2:] == (0x4B37).to_bytes(2, "little")
    assert with_crc(bytes.fromhex("09 17 04 e000 0000"))[-2:] == bytes.fromhex("4727"), "the manual's"


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
            async with asyncio.timeout(patience(5)):
                while len(data) < size:
                    arrived.clear()
                    await arrived.wait()
                    data += os.read(self.master, size - len(data))
        finally:
            loop.remove_reader(self.master)
        return data

    def close(self) -> None:
        os.close(self.master)
        os.close(self.slave)


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()


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
        frames.append(take_rtu(inbox, 9))
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
    line.send(READ)
    assert await line.receive(len(RESET_READING)) == RESET_READING
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
