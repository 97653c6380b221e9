"""Other clients: they neither hold up our writes nor lose their activation by our stop."""

from __future__ import annotations

import asyncio
from dataclasses import replace

import pytest

from robotiq_async import Finger
from robotiq_async.simulator import Trouble
from robotiq_async.values.request import AxisRequest, Request
from tests.adversity.world import World, started, world
from tests.virtual import inside

B = Finger.B


@inside(started)
async def test_a_write_does_not_wait_for_another_client_that_writes_all_the_time(
    here: World, caplog: pytest.LogCaptureFixture
) -> None:
    async def stream() -> None:
        image = Request.from_registers(here.gripper.request_registers)
        image = replace(image, axes=tuple(replace(axis, speed=0) for axis in image.axes))
        for position in range(150, 250):
            here.gripper.write(0, image.with_positions({B: position}).registers)
            await asyncio.sleep(0.005)

    await here.hand.move(50)
    streaming = asyncio.create_task(stream())
    await asyncio.sleep(0.1)
    began = here.loop.time()
    await here.hand.set_position(180, Finger.SCISSOR)
    assert here.loop.time() - began < 0.5
    streaming.cancel()
    assert len([each for each in caplog.records if "another client" in each.message]) == 1


@inside(world)
async def test_stop_over_a_new_link_leaves_what_others_have_activated_active(here: World) -> None:
    await here.hand.start(activate=False)
    here.gripper.place_object(Finger.ABC, 150)
    async with here.server.fault_injector.making(Trouble("refuse")):
        await asyncio.sleep(0.3)
        here.gripper.write(0, [0x0100])
        await asyncio.sleep(3)
        axes = (AxisRequest(255, 128, 64),) * 4
        here.gripper.write(0, Request(activate=True, go=True, axes=axes).registers)
        await asyncio.sleep(3)
    await here.hand.stop()
    await asyncio.sleep(0.2)
    asked = Request.from_registers(here.gripper.request_registers)
    assert asked.activate
    assert not asked.go
