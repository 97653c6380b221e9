"""A serial line has no transaction numbers: a late reply must not answer the next request.

The device on the other end of the pseudo-terminal is scripted here, frame by frame.
"""

from __future__ import annotations

import asyncio
import errno
import logging
import sys
from pathlib import Path

import pytest
import serial

from robotiq_async import ConnectFailedError, ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.link.serial.ports import (
    FORBIDDEN,
    MISSING,
    NO_PORT,
    TAKEN,
    names_of_adapters,
    why_no_port,
)
from tests.link.scripted_device import SPOILT, Device, reopened, unopened, wrong_checksum
from tests.link.writing import write_image
from tests.serial_line import SerialLine, with_crc

pytestmark = pytest.mark.virtual_time


async def test_read_and_write_use_the_addresses_of_the_serial_gripper(
    transport: ModbusTransport, device: Device
) -> None:
    assert await transport.read() == (5,) * 8, "after one that brings the line in step, and three after it"
    await write_image(transport, (0x0900, 0x0C00, 0, 0, 0, 0, 0, 0))
    probe, *short, read, write = device.requests
    assert probe == with_crc(bytes.fromhex("09 03 07d0 0001"))
    assert [each[:6] for each in short] == [bytes.fromhex(f"09 03 07d0 000{n}") for n in (2, 3, 4)]
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
        await (transport.read() if first == "read" else write_image(transport, (0,) * 8))
    await reopened(transport)
    for _ in range(3):
        assert await transport.read() == (len(device.requests),) * 8
    await write_image(transport, (0,) * 8)
    assert await transport.read() == (len(device.requests),) * 8


async def test_late_replies_are_dropped_while_the_port_is_opened(
    transport: ModbusTransport, device: Device
) -> None:
    device.keep = 2  # the read, and the request when it was not answered
    with pytest.raises(ResponseTimeoutError):
        await transport.read()
    await transport.open()
    assert await transport.read() == (len(device.requests),) * 8


# -- a read that is repeated -------------------------------------------------------------------------------


@pytest.mark.parametrize("how", SPOILT)
async def test_a_read_is_asked_again_when_its_answer_is_lost_or_damaged(
    transport: ModbusTransport, device: Device, how: str
) -> None:
    await transport.read()
    for number in (1, 2):
        asked = len(device.requests)
        device.spoil = SPOILT[how]
        assert await transport.read() == (len(device.requests),) * 8, "the last request is answered"
        assert transport.dialogues.repeats == number
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
        await write_image(transport, (0x0900,) * 8)
    assert [request[1] for request in device.requests[asked:]] == [16]
    assert not transport.is_open
    assert transport.dialogues.repeats == 0


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


# -- a port that cannot be opened --------------------------------------------------------------------------


@pytest.mark.skipif(sys.platform == "win32", reason="the paths and the numbers of errors are POSIX's")
@pytest.mark.parametrize(
    ("device", "why"),
    [("/dev/ttyNOWHERE", MISSING), ("/dev/null", NO_PORT), ("/tmp", NO_PORT), (__file__, NO_PORT)],
)
async def test_a_path_that_is_no_port_and_one_that_does_not_exist_differ(device: str, why: str) -> None:
    with pytest.raises(ConnectFailedError) as caught:
        await unopened(device).open()
    assert str(caught.value) == f"cannot connect to rtu://{device}: {why}"


def test_a_port_that_is_missing_is_told_with_those_that_are_there(tmp_path: Path) -> None:
    error = serial.SerialException(errno.ENOENT, "no")
    assert why_no_port(error, tmp_path / "none") == MISSING
    for device, name in (("ttyUSB1", "usb-FTDI_FT232R-if00"), ("ttyACM0", "usb-Other-if00")):
        (tmp_path / device).touch()
        (tmp_path / "by-id").mkdir(exist_ok=True)
        (tmp_path / "by-id" / name).symlink_to(tmp_path / device)
    folder = tmp_path / "by-id"
    assert why_no_port(error, folder) == f"{MISSING} These are: {tmp_path}/ttyACM0, {tmp_path}/ttyUSB1"
    assert names_of_adapters(folder)[f"{tmp_path}/ttyUSB1"] == str(folder / "usb-FTDI_FT232R-if00")


@pytest.mark.parametrize(
    ("words", "why"),
    [
        ("FileNotFoundError(2, 'The system cannot find the file specified.', None, 2)", MISSING),
        ("PermissionError(13, 'Access is denied.', None, 5)", TAKEN),
        (
            "OSError(22, 'The parameter is incorrect.', None, 87)",
            "cannot open the serial port: could not open",
        ),
    ],
)
def test_the_reasons_of_windows_are_understood(words: str, why: str, tmp_path: Path) -> None:
    """Pyserial gives no number there: it writes the error of the system into its message."""
    error = serial.SerialException(f"could not open port 'COM9': {words}")
    assert error.errno is None
    assert why_no_port(error, tmp_path).startswith(why)


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


async def test_a_port_is_opened_as_its_address_says(monkeypatch: pytest.MonkeyPatch) -> None:
    opened: list[dict[str, object]] = []

    def refuse(*_: object, **how: object) -> None:
        opened.append(how)
        raise serial.SerialException(errno.ENOENT, "no such port")

    monkeypatch.setattr(serial, "serial_for_url", refuse)
    with pytest.raises(ConnectFailedError):
        await unopened("/dev/ttyUSB7?baud=500000&parity=E&stopbits=2").open()
    (how,) = opened
    assert {"baudrate": 500000, "parity": "E", "stopbits": 2, "bytesize": 8}.items() <= how.items()
