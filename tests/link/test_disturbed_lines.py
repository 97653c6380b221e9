"""Lines as they are: they lose the first request, add a byte, echo, need a longer silence, answer "busy"."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Callable

import pytest

from robotiq_async import ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.link.line import HUSH_S
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.link.serial.silence import LONG_S
from tests.link.scripted_device import Device, unopened, wrong_checksum
from tests.link.writing import write_image
from tests.serial_line import with_crc
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

SHORT_S = 3.5 * 10 / 115200
IMAGE = (0x0900, 0x00FF, 0x4060, 0, 0, 0, 0, 0)


def counts(device: Device) -> list[int]:
    """The registers that each request read, or wrote."""
    return [int.from_bytes(request[4:6], "big") for request in device.requests]


async def newest(transport: ModbusTransport, device: Device) -> None:
    """A read gives the device's last state."""
    registers = await transport.read()
    assert registers[0] == len(device.requests)


async def reads_and_writes(transport: ModbusTransport, device: Device) -> None:
    """Reads and writes succeed in turns, none of them at the second attempt."""
    for _ in range(5):
        await newest(transport, device)
        await write_image(transport, IMAGE)
    assert transport.dialogues.repeats == 0


# -- three registers ---------------------------------------------------------------------------------------


async def test_a_jaw_is_asked_for_eight_registers_once_and_for_three_from_then_on(
    jaw: ModbusTransport, device: Device
) -> None:
    await jaw.open()
    for _ in range(3):
        await newest(jaw, device)
    await write_image(jaw, IMAGE)
    first, *others = counts(device)
    assert first == 8
    assert set(others) == {1, 2, 3}
    assert others[-4:] == [3, 3, 3, 3]
    assert device.requests[-1][:-2] == bytes.fromhex("09 10 03e8 0003 06 0900 00ff 4060")
    await jaw.open()
    assert 8 not in counts(device)[1:], "once, and not for each connection"


async def test_registers_beyond_the_three_show_a_wrong_model(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    assert await jaw.read() == (len(device.requests),) * 3 + (1,) * 5, "as the first read of eight had them"


async def test_a_jaw_that_serves_no_more_than_three_registers_works(
    jaw: ModbusTransport, device: Device
) -> None:
    device.most = 3
    await jaw.open()
    assert await jaw.read() == (len(device.requests),) * 3 + (0,) * 5
    await write_image(jaw, IMAGE)


async def test_late_replies_never_give_a_jaw_an_old_status(jaw: ModbusTransport, device: Device) -> None:
    await jaw.open()
    for late in (1, 2, 1, 3, 1):
        device.keep = late
        try:
            registers = await jaw.read()
        except RobotiqConnectionError:
            while not jaw.is_open:
                try:
                    await jaw.open()
                except RobotiqConnectionError:
                    continue
            registers = await jaw.read()
        assert registers[0] == len(device.requests)


# -- silence -----------------------------------------------------------------------------------------------


async def test_two_frames_keep_a_silence_of_3_5_characters(
    transport: ModbusTransport, device: Device
) -> None:
    for _ in range(20):
        await transport.read()
        answered = asyncio.get_running_loop().time()
        await write_image(transport, IMAGE)
        assert SHORT_S - 1e-6 <= device.asked_at - answered <= SHORT_S + 0.0001


async def test_a_device_that_needs_the_longer_silence_gets_it(
    device: Device, caplog: pytest.LogCaptureFixture
) -> None:
    """It loses what comes sooner than 1.75 ms after its reply: that is noticed before any write."""
    caplog.set_level(logging.WARNING, "robotiq_async")
    device.least_pause = LONG_S - 1e-6
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    await reads_and_writes(transport, device)
    (said,) = [each.getMessage() for each in caplog.records]
    assert "does not answer after a silence of 0.3 ms, so it gets 1.75 ms: " in said
    asked = len(device.requests)
    await transport.open()
    assert len(device.requests) == asked + 1, "a link that needs it keeps it"
    await transport.close()


async def test_a_line_that_does_not_answer_a_write_gets_the_longer_silence(device: Device) -> None:
    """The write may be a stop: the next one must not wait for a trial of the short silence."""
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    await transport.read()
    device.least_pause = LONG_S - 1e-6
    with pytest.raises(ResponseTimeoutError):
        await write_image(transport, IMAGE)
    began = asyncio.get_running_loop().time()
    await transport.open()
    await write_image(transport, IMAGE)
    assert asyncio.get_running_loop().time() - began < 0.03, "no exchange without an answer"
    await transport.close()


async def test_the_log_has_each_change_of_a_line(device: Device, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.DEBUG, "robotiq_async")
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    device.loses = 1
    await transport.read()
    await transport.close()
    said = [each.getMessage().partition("line: ")[2].partition(" (")[0] for each in caplog.records]
    assert [each for each in said if each] == [
        "CLOSED -> OPENING",
        "OPENING -> IN_STEP",
        "IN_STEP -> DISTURBED",
        "DISTURBED -> HUSHING",
        "HUSHING -> IN_STEP",
        "IN_STEP -> CLOSED",
    ]


# -- the first exchange --------------------------------------------------------------------------------------


@pytest.mark.parametrize("fate", ["lost", "damaged"])
async def test_a_line_may_lose_the_first_request_of_each_connection(device: Device, fate: str) -> None:
    transport = unopened(VirtualLine.NEAR)
    for _ in range(3):
        if fate == "lost":
            device.loses = 1
        else:
            device.spoil = wrong_checksum
        await transport.open()
        await newest(transport, device)
        await transport.close()


async def test_a_jaw_on_a_line_that_loses_the_first_request(jaw: ModbusTransport, device: Device) -> None:
    device.loses = 1
    await jaw.open()
    await newest(jaw, device)


async def test_a_device_that_never_answers_fails_the_opening_with_the_first_reason(device: Device) -> None:
    device.loses = 100
    transport = unopened(VirtualLine.NEAR)
    with pytest.raises(ResponseTimeoutError, match=r"did not answer within 0\.05 s"):
        await transport.open()
    assert not transport.is_open
    assert len(device.requests) == 2


# -- bytes too many ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("size", [1, 600, 3000])
async def test_bytes_between_two_requests_cost_a_read_and_not_the_link(
    transport: ModbusTransport, device: Device, size: int
) -> None:
    await transport.read()
    device.send(bytes(size))
    for _ in range(20):
        await asyncio.sleep(0)
    await newest(transport, device)
    assert transport.dialogues.repeats == 1
    await newest(transport, device)
    assert transport.dialogues.repeats == 1


@pytest.mark.parametrize("stray", [b"\x00", b"\xff", b"\x00\xff\x00"])
async def test_a_byte_after_the_reply_to_a_read_costs_a_read(
    transport: ModbusTransport, device: Device, stray: bytes
) -> None:
    device.spoil = lambda reply: reply + stray
    await newest(transport, device)
    assert transport.is_open


async def test_nothing_is_asked_while_the_rest_of_a_damaged_reply_comes(
    transport: ModbusTransport, device: Device
) -> None:
    """An adapter holds bytes back, and gives them out a few at a time: each of them extends the silence."""
    loop, asked_by_then = asyncio.get_running_loop(), []

    def give_out() -> None:
        device.send(b"\x00")
        asked_by_then.append(len(device.requests))

    def spoil(reply: bytes) -> bytes:
        for part in (1, 2, 3):
            loop.call_later(0.75 * HUSH_S * part, give_out)
        return wrong_checksum(reply)

    device.spoil = spoil
    asked = len(device.requests) + 1
    await newest(transport, device)
    assert asked_by_then == [asked] * 3
    await newest(transport, device)
    assert transport.dialogues.repeats == 1


@pytest.mark.parametrize("stray", [b"\x00", b"\xff", b"\x00\xff\x00"])
async def test_a_byte_after_an_acknowledgement_leaves_the_write_acknowledged(
    transport: ModbusTransport, device: Device, stray: bytes
) -> None:
    device.spoil = lambda reply: reply + stray
    await write_image(transport, IMAGE)
    await newest(transport, device)
    assert transport.dialogues.repeats == 1


async def test_a_write_does_not_meet_the_rest_of_a_disturbance(
    transport: ModbusTransport, device: Device
) -> None:
    device.spoil = lambda reply: reply + b"\x00"
    await write_image(transport, IMAGE)
    asked = len(device.requests)
    assert await transport.send(lambda: IMAGE)
    assert [request[1] for request in device.requests[asked:]] == [3, 16]
    await newest(transport, device)


@pytest.mark.parametrize("first", ["read", "write"])
async def test_a_byte_in_the_silence_before_a_request_costs_a_read(
    transport: ModbusTransport, device: Device, first: str
) -> None:
    """A floating line makes it up as the device stops sending, while the next request waits for silence."""
    await transport.read()
    asyncio.get_running_loop().call_later(0.0001, device.send, b"\xff")
    if first == "write":
        assert await transport.send(lambda: IMAGE)
    await newest(transport, device)
    assert transport.is_open


async def test_a_device_that_is_busy_at_the_opening_is_asked_again(device: Device) -> None:
    transport = unopened(VirtualLine.NEAR)
    replies = 0

    def busy_once(reply: bytes) -> bytes:
        nonlocal replies
        replies += 1
        return exception(6)(reply) if replies == 2 else reply

    device.spoil, device.spoils_all = busy_once, True
    await transport.open()
    await newest(transport, device)
    await transport.close()


async def test_an_acknowledgement_with_a_wrong_checksum_acknowledges_nothing(
    transport: ModbusTransport, device: Device
) -> None:
    device.spoil = lambda reply: wrong_checksum(reply) + b"\x00"
    with pytest.raises(ProtocolError, match="checksum"):
        await write_image(transport, IMAGE)
    assert not transport.is_open


# -- an echo -------------------------------------------------------------------------------------------------


async def test_an_echo_is_recognised_and_dropped(device: Device) -> None:
    device.echoes = True
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    await reads_and_writes(transport, device)
    await transport.close()


async def test_the_echo_of_a_write_acknowledges_nothing(device: Device) -> None:
    device.echoes = True
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    device.loses = 1
    with pytest.raises(ResponseTimeoutError):
        await write_image(transport, IMAGE)


async def test_an_echo_without_any_reply_is_no_gripper(device: Device) -> None:
    device.echoes, device.loses = True, 100
    transport = unopened(VirtualLine.NEAR)
    with pytest.raises(ResponseTimeoutError):
        await transport.open()


async def test_an_echo_that_is_missing_once_costs_a_read(device: Device) -> None:
    device.echoes = True
    transport = unopened(VirtualLine.NEAR)
    await transport.open()
    device.echoes = False

    def back(reply: bytes) -> bytes:
        device.echoes = True
        return reply

    device.spoil = back
    await newest(transport, device)
    assert transport.dialogues.repeats == 1
    await transport.close()


# -- "busy" --------------------------------------------------------------------------------------------------


def exception(code: int) -> Callable[[bytes], bytes]:
    return lambda reply: with_crc(bytes((9, reply[1] | 0x80, code)))


@pytest.mark.parametrize("code", [5, 6, 11])
async def test_a_passing_exception_to_a_read_is_asked_again(
    transport: ModbusTransport, device: Device, code: int
) -> None:
    device.spoil = exception(code)
    await newest(transport, device)
    assert transport.dialogues.repeats == 1


@pytest.mark.parametrize(
    ("code", "says"),
    [
        (2, "the gripper refuses function 3: exception 2"),
        (10, "the gateway refuses function 3: exception 10"),
    ],
)
async def test_other_exceptions_end_the_link_at_once(
    transport: ModbusTransport, device: Device, code: int, says: str
) -> None:
    asked = len(device.requests)
    device.spoil = exception(code)
    with pytest.raises(ProtocolError, match=says):
        await transport.read()
    assert len(device.requests) == asked + 1
    assert not transport.is_open


async def test_a_gateway_that_stays_busy_is_named(transport: ModbusTransport, device: Device) -> None:
    device.spoil, device.spoils_all = exception(11), True
    with pytest.raises(ProtocolError, match="the gateway refuses function 3: exception 11"):
        await transport.read()
    assert not transport.is_open


async def test_a_busy_device_gets_no_write_twice(transport: ModbusTransport, device: Device) -> None:
    asked = len(device.requests)
    device.spoil = exception(6)
    with pytest.raises(ProtocolError, match="exception 6"):
        await write_image(transport, IMAGE)
    assert len(device.requests) == asked + 1


async def test_a_damaged_exception_is_damage(transport: ModbusTransport, device: Device) -> None:
    device.spoil = lambda reply: wrong_checksum(exception(2)(reply))
    await newest(transport, device)
    assert transport.dialogues.repeats == 1
