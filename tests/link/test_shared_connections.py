"""Two transports on one serial line: what a late or silent gripper costs the other one."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from itertools import pairwise

import pytest

from robotiq_async import ProtocolError, ResponseTimeoutError, RobotiqConnectionError
from robotiq_async.link.address import parse_address
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.link.outcome import Silent
from robotiq_async.link.serial.patience import SOON, LinePatience
from robotiq_async.values.registers import REGISTER_COUNT, RTU_REGISTERS
from tests.link.scripted_device import Device, reopened, unopened
from tests.link.writing import write_image
from tests.serial_line import with_crc
from tests.virtual import until
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

LEFT, RIGHT = 9, 12
IMAGE = (0,) * REGISTER_COUNT
SILENT_S = 1e6
SILENT = Silent(ResponseTimeoutError("no answer"))


@pytest.fixture
async def pair(device: Device) -> AsyncIterator[tuple[ModbusTransport, ModbusTransport]]:
    """Two that are open; the device answers for both."""
    left, right = (
        unopened(VirtualLine.NEAR, replace(RTU_REGISTERS, device_id=unit), shares_line=True)
        for unit in (LEFT, RIGHT)
    )
    await left.open()
    await right.open()
    device.requests.clear()
    yield left, right
    await left.close()
    await right.close()


Pair = tuple[ModbusTransport, ModbusTransport]


async def test_a_late_reply_for_one_does_not_meet_a_write_of_the_other(pair: Pair, device: Device) -> None:
    left, right = pair
    device.late[LEFT] = 0.055
    reading = asyncio.create_task(left.read())
    await asyncio.sleep(0.051)
    assert device.requests
    device.late = {RIGHT: 0.01}
    await write_image(right, IMAGE)
    await reading
    assert left.is_open
    assert right.is_open
    assert [request[0] for request in device.requests[:4]] == [LEFT] * 3 + [RIGHT], (
        "it is asked again at once"
    )


async def test_the_rest_of_a_cancelled_exchange_does_not_meet_a_write_of_the_other(
    pair: Pair, device: Device
) -> None:
    left, right = pair
    device.late |= {LEFT: 0.002, RIGHT: 0.004}
    reading = asyncio.create_task(left.read())
    await asyncio.sleep(0.001)
    reading.cancel()
    await asyncio.wait([reading])
    assert not left.is_open
    await write_image(right, IMAGE)
    assert right.is_open


async def test_who_is_cancelled_between_two_turns_takes_no_late_reply_for_a_later_one(
    pair: Pair, device: Device
) -> None:
    """A late acknowledgement was taken for that of a stop which the gripper had not heard."""
    left, right = pair
    device.late = {LEFT: 0.13, RIGHT: 0.03}
    moving = asyncio.create_task(left.send_and_read(lambda: IMAGE))
    await asyncio.sleep(0.001)
    reading = asyncio.create_task(right.read())
    await until(lambda: device.requests[-1][0] == RIGHT)
    moving.cancel()
    await asyncio.wait([moving, reading])
    assert moving.cancelled()
    assert right.is_open, "the exchange of the other goes on"
    device.late, device.loses = {}, 1
    with pytest.raises(RobotiqConnectionError):
        await write_image(left, IMAGE)


async def test_a_silent_gripper_is_asked_now_and_then(pair: Pair, device: Device) -> None:
    left, right = pair
    device.late[LEFT] = SILENT_S

    async def poll() -> None:
        while True:
            await right.read()
            await asyncio.sleep(0.005)

    polling = asyncio.create_task(poll())
    for _ in range(12):
        with contextlib.suppress(RobotiqConnectionError):
            await (left.read() if left.is_open else left.open())
    polling.cancel()
    units = [request[0] for request in device.requests]
    tries = [place for place, unit in enumerate(units) if unit == LEFT]
    assert len(tries) > 12
    assert all(later - earlier > 10 for earlier, later in pairwise(tries[1:])), "for some polls of the other"
    assert all(later - earlier > 150 for earlier, later in pairwise(tries[SOON:])), "for a second"


def test_a_question_waits_longer_where_answers_have_just_taken_long() -> None:
    patience, left, right = LinePatience(), Device, ModbusTransport
    assert patience.seconds(left, 0.4) == 0.06
    assert patience.seconds(left, 2.0) == pytest.approx(0.3), "by the response timeout"
    patience.note(left, SILENT, 0.0, 0.0)
    assert patience.seconds(left, 0.4) == 0.024
    patience.note(right, b"", 1.0, 3.0)
    patience.note(right, b"", 3.0, 3.003)
    assert patience.seconds(left, 0.4) == 0.024, "the loop was held up, and the line is as fast as before"
    for _ in range(2):
        patience.note(right, b"", 4.0, 4.04)
    assert patience.seconds(left, 0.4) == patience.seconds(right, 0.4) == pytest.approx(0.16)
    assert patience.seconds(left, 0.1) == 0.1, "never beyond the response timeout"
    for _ in range(100):
        patience.note(right, b"", 2.0, 2.003)
    assert (patience.seconds(left, 0.4), patience.seconds(right, 0.4)) == (0.024, 0.06)


async def test_an_answer_that_is_too_late_costs_the_other_no_write(pair: Pair, device: Device) -> None:
    """It comes as a whole, and before the acknowledgement: devices of a gateway answer in order."""
    left, right = pair
    device.late[LEFT] = SILENT_S
    reading = asyncio.create_task(left.read())
    await asyncio.sleep(0.08)
    late = with_crc(bytes((LEFT, 3, 6, *range(6))))
    device.spoil = lambda _: late[:4]
    writing = asyncio.create_task(write_image(right, IMAGE))
    await until(lambda: device.requests[-1][:2] == bytes((RIGHT, 16)))
    device.send(late[4:] + with_crc(device.requests[-1][:6]))
    await writing
    assert right.is_open
    reading.cancel()
    await asyncio.wait([reading])


async def test_each_request_has_the_line_alone(pair: Pair, device: Device) -> None:
    left, right = pair
    device.late |= {LEFT: 0.004, RIGHT: 0.006}
    loop = asyncio.get_running_loop()
    began = loop.time()
    await asyncio.gather(left.read(), right.read(), write_image(left, IMAGE), write_image(right, IMAGE))
    assert [request[0] for request in device.requests] == [LEFT, RIGHT, LEFT, RIGHT]
    assert loop.time() - began == pytest.approx(0.02, abs=0.003)


async def test_a_slow_gripper_that_opens_has_one_exchange_a_turn(pair: Pair, device: Device) -> None:
    left, right = pair
    device.late[LEFT] = 0.04
    loop, longest = asyncio.get_running_loop(), 0.0
    opening = asyncio.create_task(left.open())
    while not opening.done():
        began = loop.time()
        await right.read()
        longest = max(longest, loop.time() - began)
        await asyncio.sleep(0.001)
    assert 0.039 < longest < 0.05


@pytest.mark.parametrize(("image", "function"), [(IMAGE, 16), (None, 3)])
async def test_a_stop_or_a_read_is_decided_when_the_turn_comes(
    pair: Pair, device: Device, image: tuple[int, ...] | None, function: int
) -> None:
    left, right = pair
    device.late[LEFT] = 0.04
    loop, asked = asyncio.get_running_loop(), list[float]()

    def decide() -> tuple[int, ...] | None:
        asked.append(loop.time())
        return image

    reading = asyncio.create_task(left.read())
    await asyncio.sleep(0.001)
    began = loop.time()
    registers = await right.stop_or_read(decide)
    assert (registers is None) == (image is not None)
    assert [at - began for at in asked] == [pytest.approx(0.04, abs=0.005)]
    assert device.requests[-1][:2] == bytes((RIGHT, function))
    await reading


async def test_a_disturbed_line_is_read_before_a_stop_is_written(pair: Pair, device: Device) -> None:
    _, right = pair
    device.send(b"\x00\x01")
    await asyncio.sleep(0.01)
    assert await right.stop_or_read(lambda: IMAGE) is not None
    assert all(request[1] == 3 for request in device.requests)
    assert await right.stop_or_read(lambda: IMAGE) is None


async def test_a_link_that_was_lost_decides_nothing(pair: Pair, device: Device) -> None:
    _, right = pair
    await right.close()
    asked: list[None] = []
    with pytest.raises(RobotiqConnectionError, match="not connected"):
        await right.stop_or_read(lambda: asked.append(None))
    assert not asked
    assert not device.requests


async def test_a_line_that_never_becomes_silent_is_a_protocol_error_for_each(device: Device) -> None:
    """One gives its turn away when its wait for silence is over, and the line still talks."""
    left, right = (
        ModbusTransport(
            parse_address(f"rtu://{VirtualLine.NEAR}"),
            replace(RTU_REGISTERS, device_id=unit),
            connect_timeout=1.0,
            response_timeout=0.4,
            shares_line=True,
        )
        for unit in (LEFT, RIGHT)
    )
    await left.open()
    await right.open()

    async def babble() -> None:
        while True:
            device.send(b"\x00")
            await asyncio.sleep(0.01)

    babbling = asyncio.create_task(babble())
    reading = asyncio.create_task(left.read())
    await asyncio.sleep(0.05)
    ends = await asyncio.gather(reading, right.read(), return_exceptions=True)
    babbling.cancel()
    assert [type(end) for end in ends] == [ProtocolError] * 2
    for each in (left, right):
        await reopened(each)
        await each.read()
        await each.close()
