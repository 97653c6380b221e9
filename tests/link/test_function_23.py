"""Function 23: a write and a read in one exchange, and what is left of it when the reply does not come."""

from __future__ import annotations

import logging

import pytest

from robotiq_async import ProtocolError, ResponseTimeoutError
from robotiq_async.link.modbus import ModbusTransport
from tests.link.scripted_device import SPOILT, Device, wrong_checksum
from tests.link.test_disturbed_lines import IMAGE, exception
from tests.serial_line import with_crc

pytestmark = pytest.mark.virtual_time


def functions(device: Device, since: int = 0) -> list[int]:
    return [request[1] for request in device.requests[since:]]


async def test_a_jaw_is_written_and_read_in_one_exchange(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    assert jaw.reads_with_writes
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert device.requests[-1] == with_crc(bytes.fromhex("09 17 07d0 0003 03e8 0003 06 0900 00ff 4060"))
    assert answer is not None
    assert answer.doubt is None
    assert answer.registers[:3] == (len(device.requests),) * 3


async def test_nothing_to_write_is_nothing_sent(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    asked = len(device.requests)
    assert await jaw.send_and_read(lambda: None) is None
    assert len(device.requests) == asked


@pytest.mark.parametrize("how", SPOILT)
async def test_a_missing_or_damaged_reply_leaves_doubt_and_the_link(
    jaw: ModbusTransport, device: Device, how: str
) -> None:
    await jaw.open()
    await jaw.send_and_read(lambda: IMAGE)
    asked = len(device.requests)
    device.spoil = SPOILT[how]
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert isinstance(answer.doubt, ProtocolError | ResponseTimeoutError)
    assert answer.registers[0] == len(device.requests), "what the device said last"
    assert functions(device, asked) == [23, 3, 3], "the write is not repeated"
    assert jaw.is_open
    assert jaw.reads_with_writes, "the device serves it: it did before"
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert answer.doubt is None


async def test_a_late_reply_is_never_the_status(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    await jaw.send_and_read(lambda: IMAGE)
    device.keep = 1
    with pytest.raises((ProtocolError, ResponseTimeoutError)):  # the device answers in order: it comes first
        await jaw.send_and_read(lambda: IMAGE)
    assert not jaw.is_open
    await jaw.open()
    assert (await jaw.read())[0] == len(device.requests)


async def test_a_reply_that_stays_damaged_ends_the_link(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    device.spoil, device.spoils_all = wrong_checksum, True
    with pytest.raises(ProtocolError, match="checksum"):
        await jaw.send_and_read(lambda: IMAGE)
    assert not jaw.is_open


async def test_a_stray_byte_after_the_reply_costs_the_next_read(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    device.spoil = lambda reply: reply + b"\x00"
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert answer.doubt is None
    assert (await jaw.read())[0] == len(device.requests)
    assert jaw.dialogues.repeats == 1


async def test_a_device_that_refuses_the_function_is_written_with_16(
    jaw: ModbusTransport, device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.WARNING, "robotiq_async")
    device.has_23, device.refuses = False, True
    await jaw.open()
    asked = len(device.requests)
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert answer.doubt is None
    assert functions(device, asked) == [23, 16, 3], "it was refused, so it can be written again"
    assert not jaw.reads_with_writes
    (said,) = [each.getMessage() for each in caplog.records]
    assert "is written with function 16: the gripper refuses function 23" in said
    assert "read_function" not in said, "that would ask with another function"


async def test_what_was_refused_is_decided_again(jaw: ModbusTransport, device: Device) -> None:
    """A stop may have come while the refusal was on its way."""
    device.has_23, device.refuses = False, True
    await jaw.open()
    asked, images = len(device.requests), [None, IMAGE]
    assert await jaw.send_and_read(images.pop) is None
    assert functions(device, asked) == [23], "nothing is written in its place"
    assert jaw.is_open


async def test_a_device_that_does_not_answer_the_function_is_written_with_16_from_then_on(
    jaw: ModbusTransport, device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    """A jaw answers no bad request. Whether it was carried out is unknown, so it is not written again."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    device.has_23 = False
    await jaw.open()
    asked = len(device.requests)
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert isinstance(answer.doubt, ResponseTimeoutError)
    assert functions(device, asked) == [23, 3, 3]
    assert not jaw.reads_with_writes
    assert "is written with function 16" in caplog.text


async def test_other_exceptions_leave_doubt(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    await jaw.send_and_read(lambda: IMAGE)
    asked = len(device.requests)
    device.spoil = exception(4)
    answer = await jaw.send_and_read(lambda: IMAGE)
    assert answer is not None
    assert isinstance(answer.doubt, ProtocolError)
    assert functions(device, asked) == [23, 3, 3]
