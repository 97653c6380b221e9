"""Two transports on one serial line: what a late or silent gripper costs the other one."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator
from dataclasses import replace
from itertools import pairwise

import pytest

from robotiq_async import RobotiqConnectionError
from robotiq_async.link.modbus import ModbusTransport
from robotiq_async.values.registers import REGISTER_COUNT, RTU_REGISTERS
from tests.link.scripted_device import Device, unopened
from tests.virtual_line import VirtualLine

pytestmark = pytest.mark.virtual_time

LEFT, RIGHT = 9, 12
IMAGE = (0,) * REGISTER_COUNT
SILENT_S = 1e6


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
    await right.write(IMAGE)
    await reading
    assert right.is_open
    assert [request[0] for request in device.requests[:2]] == [LEFT, RIGHT]


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
    await right.write(IMAGE)
    assert right.is_open


async def test_a_silent_gripper_leaves_the_line_to_the_other_for_twenty_polls(
    pair: Pair, device: Device
) -> None:
    left, right = pair
    device.late[LEFT] = SILENT_S

    async def poll() -> None:
        while True:
            await right.read()
            await asyncio.sleep(0.005)

    polling = asyncio.create_task(poll())
    for _ in range(5):
        with contextlib.suppress(RobotiqConnectionError):
            await (left.read() if left.is_open else left.open())
    polling.cancel()
    units = [request[0] for request in device.requests]
    tries = [place for place, unit in enumerate(units) if unit == LEFT]
    assert len(tries) > 5
    assert all(later - earlier > 15 for earlier, later in pairwise(tries))


async def test_each_request_has_the_line_alone(pair: Pair, device: Device) -> None:
    left, right = pair
    device.late |= {LEFT: 0.004, RIGHT: 0.006}
    loop = asyncio.get_running_loop()
    began = loop.time()
    await asyncio.gather(left.read(), right.read(), left.write(IMAGE), right.write(IMAGE))
    assert [request[0] for request in device.requests] == [LEFT, RIGHT, LEFT, RIGHT]
    assert loop.time() - began == pytest.approx(0.02, abs=0.003)
