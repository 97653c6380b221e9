"""A serial line has no transaction numbers: a late reply must not answer the next request.

The device on the other end of the pseudo-terminal is scripted here, frame by frame.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import os
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest
import serial

from robotiq_async import ConnectFailedError, ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.link.serial_ports import FORBIDDEN, MISSING, NO_PORT, TAKEN
from robotiq_async.wire.registers import RTU_REGISTERS
from tests.serial_line import SerialLine


def with_crc(frame: bytes) -> bytes:
    crc = 0xFFFF
    for byte in frame:
        crc ^= byte
        for _ in range(8):
            crc = crc >> 1 ^ (0xA001 if crc & 1 else 0)
    return frame + crc.to_bytes(2, "little")


class Device:
    """Answers reads with the number of the request in every register; replies can be kept back."""

    def __init__(self, descriptor: int) -> None:
        self.descriptor = descriptor
        self.requests: list[bytes] = []
        self.keep = 0
        """Replies to be kept back from here on."""
        self.kept: list[bytes] = []
        self.spoil = False
        """Whether checksums are wrong from here on."""
        asyncio.get_running_loop().add_reader(descriptor, self._ready)
        self._inbox = b""

    def _ready(self) -> None:
        self._inbox += os.read(self.descriptor, 4096)
        while len(self._inbox) >= 8:
            size = 8 if self._inbox[1] == 3 else 9 + self._inbox[6]
            if len(self._inbox) < size:
                return
            request, self._inbox = self._inbox[:size], self._inbox[size:]
            self.requests.append(request)
            reply = self._reply(request)
            if self.spoil:
                reply = reply[:-1] + bytes((reply[-1] ^ 1,))
            if self.keep:
                self.keep -= 1
                self.kept.append(reply)
            else:
                # A serial device answers in order: what was late comes first.
                kept, self.kept = self.kept, []
                os.write(self.descriptor, b"".join(kept) + reply)

    def _reply(self, request: bytes) -> bytes:
        if request[1] == 16:
            return with_crc(request[:6])
        count = int.from_bytes(request[4:6], "big")
        return with_crc(bytes((9, 3, 2 * count)) + len(self.requests).to_bytes(2, "big") * count)


@asynccontextmanager
async def linked(folder: Path) -> AsyncIterator[tuple[ModbusTransport, Device]]:
    with SerialLine(folder) as line:
        far = os.open(line.far, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
        device = Device(far)
        transport = ModbusTransport(
            parse_address(f"rtu://{line.near}"), RTU_REGISTERS, connect_timeout=1.0, response_timeout=0.05
        )
        try:
            await transport.open()
            yield transport, device
        finally:
            await transport.close()
            asyncio.get_running_loop().remove_reader(far)
            os.close(far)


async def reopened(transport: ModbusTransport) -> int:
    """Open again until it works; returns the failures before."""
    for failures in range(10):
        with contextlib.suppress(RobotiqConnectionError):
            await transport.open()
            return failures
    raise AssertionError("never in step again")


async def test_read_and_write_use_the_addresses_of_the_serial_gripper(tmp_path: Path) -> None:
    async with linked(tmp_path) as (transport, device):
        assert await transport.read() == (2,) * 8
        await transport.write((0x0900, 0x0C00, 0, 0, 0, 0, 0, 0))
    probe, read, write = device.requests
    assert probe == with_crc(bytes.fromhex("09 03 07d0 0001"))
    assert read == with_crc(bytes.fromhex("09 03 07d0 0008"))
    assert write[:11] == bytes.fromhex("09 10 03e8 0008 10 0900 0c00")


@pytest.mark.parametrize("late", [1, 2, 3, 8])
@pytest.mark.parametrize("first", ["read", "write"])
async def test_late_replies_never_answer_a_later_request(tmp_path: Path, late: int, first: str) -> None:
    async with linked(tmp_path) as (transport, device):
        await transport.read()
        device.keep = late
        with pytest.raises(ResponseTimeoutError):
            await (transport.read() if first == "read" else transport.write((0,) * 8))
        await reopened(transport)
        for _ in range(3):
            assert await transport.read() == (len(device.requests),) * 8
        await transport.write((0,) * 8)
        assert await transport.read() == (len(device.requests),) * 8


async def test_a_late_reply_is_found_out_while_the_port_is_opened(tmp_path: Path) -> None:
    async with linked(tmp_path) as (transport, device):
        device.keep = 1
        with pytest.raises(ResponseTimeoutError):
            await transport.read()
        with pytest.raises(ProtocolError):
            await transport.open()
        assert not transport.is_open


async def test_a_wrong_check_sum_is_no_answer(tmp_path: Path) -> None:
    async with linked(tmp_path) as (transport, device):
        device.spoil = True
        with pytest.raises(ResponseTimeoutError):
            await transport.read()


@pytest.mark.parametrize("size", [600, 3000])
async def test_a_burst_between_two_requests_is_found_out(tmp_path: Path, size: int) -> None:
    async with linked(tmp_path) as (transport, device):
        await transport.read()
        os.write(device.descriptor, bytes(size))
        for _ in range(20):
            await asyncio.sleep(0)
        with pytest.raises(ProtocolError, match=r"nobody asked for|not the answer"):  # as it arrives
            await transport.read()
        assert not transport.is_open


# -- a port that cannot be opened --------------------------------------------------------------------------


def unopened(device: str) -> ModbusTransport:
    address = parse_address(f"rtu://{device}")
    return ModbusTransport(address, RTU_REGISTERS, connect_timeout=1.0, response_timeout=0.05)


@pytest.mark.parametrize(
    ("device", "why"),
    [("/dev/ttyNOWHERE", MISSING), ("/dev/null", NO_PORT), ("/tmp", NO_PORT), (__file__, NO_PORT)],
)
async def test_what_is_no_port_is_told_from_what_is_not_there(device: str, why: str) -> None:
    with pytest.raises(ConnectFailedError) as caught:
        await unopened(device).open()
    assert str(caught.value) == f"cannot connect to rtu://{device}: {why}"


async def test_a_port_of_another_program_is_told(tmp_path: Path) -> None:
    async with linked(tmp_path) as (_, _device):
        with pytest.raises(ConnectFailedError) as caught:
            await unopened(f"{tmp_path}/ttyNEAR").open()
    assert TAKEN in str(caught.value)


@pytest.mark.parametrize(
    ("error", "why"),
    [
        (serial.SerialException(errno.EACCES, "could not open port x: Permission denied"), FORBIDDEN),
        (serial.SerialException(errno.EIO, "no"), "cannot open the serial port: .*no"),
        (serial.SerialException("could not open port 'COM3'"), "cannot open the serial port: could not open"),
    ],
)
async def test_a_port_that_is_forbidden_and_anything_else(
    error: OSError, why: str, monkeypatch: pytest.MonkeyPatch
) -> None:
    def refuse(*_: object, **__: object) -> None:
        raise error

    # pyserial is below what is tested; whoever runs this may open everything, perhaps.
    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(ConnectFailedError, match=why if why != FORBIDDEN else "not allowed to open it"):
        await unopened("/dev/ttyUSB7").open()
