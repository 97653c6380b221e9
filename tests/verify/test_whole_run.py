"""A run from the first stage to the last, against a gripper that is what the library assumes."""

from __future__ import annotations

import pytest

from tests.verify.people import Helper, Roll, assert_as_assumed, served, verified

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize("serial", [False, True], ids=["tcp", "paced serial line"])
async def test_a_plain_gripper_is_as_assumed_in_every_stage(serial: bool) -> None:
    async with served(serial=serial) as server:
        helper, roll = Helper(server), Roll()
        report = await verified(server, helper, roll)
        assert_as_assumed(report)
        assert report.stages == roll.stages == list(range(10))
        assert not helper.alarms
        assert not server.gripper.is_moving
