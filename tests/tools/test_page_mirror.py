"""A hand on the page of another process."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.web.page.mirror import HandMirror
from robotiq_async.tools.web.server import HandUpdates
from robotiq_async.values.model import TWO_FINGER_85

pytestmark = pytest.mark.virtual_time


async def test_the_measured_opening_reaches_the_page() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, model=TWO_FINGER_85)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address, stroke=((13, 100.0), (213, 2.0))) as hand,
    ):
        page = HandMirror(0, hand.address)
        page.hear(HandUpdates(hand).take(0))
        assert page.status is not None
        assert page.status.stroke == hand.units.stroke
