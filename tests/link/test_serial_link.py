"""A serial line has no transaction numbers: a late reply must not answer the next request.

The device on the other end of the pseudo-terminal is scripted here, frame by frame.
"""

from __future__ import annotations

import asyncio
import contextlib
import errno
import logging
from collections.abc import AsyncIterator, Callable
from pathlib import Path

import pytest
import serial

from robotiq_async import ConnectFailedError, ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.link.serial_ports import FORBIDDEN, MISSING, NO_PORT, TAKEN
from robotiq_async.values.registers import RTU_REGISTERS
from tests.serial_line import SerialLine, with_crc
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time


class Device:
    """Answers reads with the number of the request in every register; replies can be kept back."""

    def __init__(self, port: serial.Serial) -> None:
        self._port = port
        self.requests: list[bytes] = []
        self.asked_at = 0.0
        self.keep = 0
        """Replies to be kept back from here on."""
        self.kept: list[bytes] = []
        self.spoil: Callable[[bytes], bytes] | None = None
        """What becomes of the next reply; of every one, if :attr:`spoils_all`."""
        self.spoils_all = False
        self._inbox = b""
        self._loop = asyncio.get_running_loop()
        self._loop.add_reader(port.fileno(), self._ready)

    def send(self, data: bytes) -> None:
        """Put bytes on the line."""
        self._port.write(data)

    def close(self) -> None:
        self._loop.remove_reader(self._port.fileno())
        self._port.close()

    def _ready(self) -> None:
        self._inbox += self._port.read(4096)
        while len(self._inbox) >= 8:
            size = 8 if self._inbox[1] == 3 else 9 + self._inbox[6]
            if len(self._inbox) < size:
                return
            request, self._inbox = self._inbox[:size], self._inbox[size:]
            self.requests.append(request)
            self.asked_at = self._loop.time()
            reply = self._reply(request)
            if self.spoil is not None:
                reply = self.spoil(reply)
                self.spoil = self.spoil if self.spoils_all else None
            if self.keep:
                self.keep -= 1
                self.kept.append(reply)
            else:
                # A serial device answers in order: what was late comes first.
                kept, self.kept = self.kept, []
                self.send(b"".join(kept) + reply)

    def _reply(self, request: bytes) -> bytes:
        if request[1] == 16:
            return with_crc(request[:6])
        count = int.from_bytes(request[4:6], "big")
        return with_crc(bytes((9, 3, 2 * count)) + len(self.requests).to_bytes(2, "big") * count)


@pytest.fixture
async def device(monkeypatch: pytest.MonkeyPatch) -> AsyncIterator[Device]:
    """At the far end of a line, in virtual time."""
    VirtualLine(monkeypatch)
    device = Device(serial.serial_for_url(VirtualLine.FAR))
    yield device
    device.close()


@pytest.fixture
async def transport(device: Device) -> AsyncIterator[ModbusTransport]:
    """At the near end, open."""
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    yield transport
    await transport.close()


def unopened(device: str) -> ModbusTransport:
    address = parse_address(f"rtu://{device}")
    return ModbusTransport(address, RTU_REGISTERS, connect_timeout=1.0, response_timeout=0.05)


async def reopened(transport: ModbusTransport) -> int:
    """Open again until it works; returns the failures before."""
    for failures in range(10):
        with contextlib.suppress(RobotiqConnectionError):
            await transport.open()
            return failures
    raise AssertionError("never in step again")


async def test_read_and_write_use_the_addresses_of_the_serial_gripper(
    transport: ModbusTransport, device: Device
) -> None:
    assert await transport.read() == (2,) * 8
    await transport.write((0x0900, 0x0C00, 0, 0, 0, 0, 0, 0))
    probe, read, write = device.requests
    assert probe == with_crc(bytes.fromhex("09 03 07d0 0001"))
    assert read == with_crc(bytes.fromhex("09 03 07d0 0008"))
    assert write[:11] == bytes.fromhex("09 10 03e8 0008 10 0900 0c00")


@pytest.mark.parametrize("late", [1, 2, 8])
@pytest.mark.parametrize("first", ["read", "write"])
async def test_late_replies_never_answer_a_later_request(
    transport: ModbusTransport, device: Device, late: int, first: str
) -> None:
    await transport.read()
    device.keep = late
    with pytest.raises(ResponseTimeoutError):
        await (transport.read() if first == "read" else transport.write((0,) * 8))
    await reopened(transport)
    for _ in range(3):
        assert await transport.read() == (len(device.requests),) * 8
    await transport.write((0,) * 8)
    assert await transport.read() == (len(device.requests),) * 8


async def test_a_late_reply_is_found_out_while_the_port_is_opened(
    transport: ModbusTransport, device: Device
) -> None:
    device.keep = 2  # the read, and what was asked when it was not answered
    with pytest.raises(ResponseTimeoutError):
        await transport.read()
    with pytest.raises(ProtocolError):
        await transport.open()
    assert not transport.is_open


# -- a read that is asked once more ------------------------------------------------------------------------


def wrong_checksum(reply: bytes) -> bytes:
    return reply[:-1] + bytes((reply[-1] ^ 1,))


SPOILT = {
    "lost": lambda reply: reply[:0],
    "wrong checksum": wrong_checksum,
    "first byte": lambda reply: bytes((reply[0] ^ 4,)) + reply[1:],
    "byte count": lambda reply: reply[:2] + bytes((reply[2] ^ 1,)) + reply[3:],
    "last byte lost": lambda reply: reply[:-1],
    "first byte lost": lambda reply: reply[1:],
    "all but one byte lost": lambda reply: reply[:1],
}


@pytest.mark.parametrize("how", SPOILT)
async def test_a_read_is_asked_again_when_its_answer_is_lost_or_damaged(
    transport: ModbusTransport, device: Device, how: str
) -> None:
    await transport.read()
    for number in (1, 2):
        asked = len(device.requests)
        device.spoil = SPOILT[how]
        assert await transport.read() == (len(device.requests),) * 8, "the last request is answered"
        assert transport.repeats == number
        first, probe, again = device.requests[asked:]
        assert first == again
        assert probe[:5] == first[:5], "a read, of the same registers"
        assert probe[5] < 8, "and of fewer"
    assert await transport.read() == (len(device.requests),) * 8


@pytest.mark.parametrize("how", SPOILT)
async def test_a_write_is_never_sent_again(transport: ModbusTransport, device: Device, how: str) -> None:
    asked = len(device.requests)
    device.spoil = SPOILT[how]
    with pytest.raises(RobotiqConnectionError):
        await transport.write((0x0900,) * 8)
    assert [request[1] for request in device.requests[asked:]] == [16]
    assert not transport.is_open
    assert transport.repeats == 0


@pytest.mark.parametrize("spoilt", range(1, 3))
async def test_a_read_is_asked_once_more_and_no_oftener(
    transport: ModbusTransport, device: Device, spoilt: int
) -> None:
    """The second time nothing may be wrong, neither with what brings the line in step nor with the answer."""
    counts: list[int] = []

    def spoil(reply: bytes) -> bytes:
        counts.append(reply[2] // 2)
        return wrong_checksum(reply) if len(counts) in (1, 1 + spoilt) else reply

    device.spoil, device.spoils_all = spoil, True
    with pytest.raises(ProtocolError, match="a wrong checksum"):
        await transport.read()
    assert len(counts) == 1 + spoilt
    assert counts[0] == 8
    assert not transport.is_open


@pytest.mark.parametrize("after", ["the silence", "the probe"])
async def test_the_first_answer_that_was_only_late_is_not_the_second(
    transport: ModbusTransport, device: Device, after: str
) -> None:
    await transport.read()
    asked = len(device.requests)
    device.keep = 1
    reading = asyncio.ensure_future(transport.read())
    while not device.kept:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    if after == "the silence":
        await asyncio.sleep(0.055)  # the time-out has passed, and the silence has begun
        device.send(device.kept.pop())
        assert await reading == (asked + 3,) * 8
        assert transport.is_open
    else:
        with pytest.raises(ResponseTimeoutError):  # the device answers in order: the late one comes first
            await reading
        assert not transport.is_open
    await reopened(transport)
    assert await transport.read() == (len(device.requests),) * 8


@pytest.mark.parametrize(("pieces", "pause"), [(4, 0.005), (6, 0.012)])
async def test_the_rest_of_a_damaged_answer_is_no_part_of_the_next(
    transport: ModbusTransport, device: Device, pieces: int, pause: float
) -> None:
    device.spoil = lambda reply: b"\xff" + reply[:10]
    reading = asyncio.ensure_future(transport.read())
    for _ in range(pieces):
        await asyncio.sleep(pause)
        device.send(bytes.fromhex("09 03 10 00 00"))
    assert await reading == (len(device.requests),) * 8
    assert await transport.read() == (len(device.requests),) * 8, "nor of the one after it"


async def test_a_device_that_never_falls_silent_is_given_up(
    transport: ModbusTransport, device: Device
) -> None:
    device.spoil = lambda reply: b"\xff" + reply[:0]
    reading = asyncio.ensure_future(transport.read())
    began = asyncio.get_running_loop().time()
    while not reading.done():
        device.send(b"\xff")
        await asyncio.sleep(0.005)
    assert asyncio.get_running_loop().time() - began < 0.5
    with pytest.raises(ProtocolError):
        await reading
    assert not transport.is_open


async def test_a_read_that_is_never_answered_takes_two_response_timeouts(
    transport: ModbusTransport, device: Device
) -> None:
    device.spoil, device.spoils_all = SPOILT["lost"], True
    began = asyncio.get_running_loop().time()
    with pytest.raises(ResponseTimeoutError):
        await transport.read()
    assert 0.099 <= asyncio.get_running_loop().time() - began < 0.15


async def test_cancelled_while_the_line_falls_silent(transport: ModbusTransport, device: Device) -> None:
    device.spoil = wrong_checksum
    reading = asyncio.ensure_future(transport.read())
    while len(device.requests) < 2:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    await asyncio.sleep(0.005)
    reading.cancel()
    with pytest.raises(asyncio.CancelledError):
        await reading
    assert not transport.is_open


async def test_repeated_reads_are_logged_now_and_then(
    transport: ModbusTransport, device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    for _ in range(3):
        device.spoil = wrong_checksum
        await transport.read()
    said = [each.getMessage() for each in caplog.records if "was repeated" in each.getMessage()]
    assert len(said) == 1
    assert "a wrong checksum" in said[0]


async def test_two_frames_keep_the_silence_of_the_standard(
    transport: ModbusTransport, device: Device
) -> None:
    for _ in range(20):
        await transport.read()
        answered = asyncio.get_running_loop().time()
        await transport.write((0,) * 8)
        assert device.asked_at - answered >= 0.0016


@pytest.mark.parametrize("size", [600, 3000])
async def test_a_burst_between_two_requests_is_found_out(
    transport: ModbusTransport, device: Device, size: int
) -> None:
    await transport.read()
    device.send(bytes(size))
    for _ in range(20):
        await asyncio.sleep(0)
    with pytest.raises(ProtocolError, match=r"without a request|not the answer"):  # as it arrives
        await transport.read()
    assert not transport.is_open


# -- a port that cannot be opened --------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("device", "why"),
    [("/dev/ttyNOWHERE", MISSING), ("/dev/null", NO_PORT), ("/tmp", NO_PORT), (__file__, NO_PORT)],
)
async def test_a_path_that_is_no_port_and_one_that_does_not_exist_differ(device: str, why: str) -> None:
    with pytest.raises(ConnectFailedError) as caught:
        await unopened(device).open()
    assert str(caught.value) == f"cannot connect to rtu://{device}: {why}"


async def test_a_port_of_another_program_is_reported(tmp_path: Path) -> None:
    with (
        SerialLine(tmp_path) as line,
        serial.Serial(str(line.near), exclusive=True),
        pytest.raises(ConnectFailedError) as caught,
    ):
        await unopened(str(line.near)).open()
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

    # pyserial is below what is tested; the user who runs this may open everything, perhaps.
    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(ConnectFailedError, match=why if why != FORBIDDEN else "not allowed to open it"):
        await unopened("/dev/ttyUSB7").open()
