"""A run from the first stage to the last, against a gripper that is what the library assumes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_140, Model
from tests.verify.people import SHORT, Helper, Roll, assert_as_assumed, served, verified

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize(
    ("serial", "model"),
    [
        (False, THREE_FINGER),
        (True, THREE_FINGER),
        (False, TWO_FINGER_140),
        (True, HAND_E),
    ],
    ids=lambda value: "serial" if value is True else "tcp" if value is False else value.name,
)
async def test_a_plain_gripper_is_as_assumed_in_every_stage(serial: bool, model: Model) -> None:
    # As often as in earnest once, with a jaw: it moves for less time. The 2F-85: with physics, and replayed.
    lengths = replace(SHORT, interval=None) if model is TWO_FINGER_140 else SHORT
    async with served(serial=serial, model=model) as server:
        helper, roll = Helper(server), Roll()
        report = await verified(server, helper, roll, lengths=lengths)
        assert_as_assumed(report)
        assert report.stages == roll.stages == list(range(10))
        assert not helper.alarms
        assert not server.gripper.is_moving
