"""A run from the first stage to the last, against a gripper that is what the library assumes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_140, Model
from tests.verify.people import SHORT, Helper, Roll, assert_as_assumed, served, verified

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize(
    ("serial", "model", "last"),
    [(False, THREE_FINGER, 9), (True, THREE_FINGER, 5), (True, TWO_FINGER_140, 9), (False, HAND_E, 6)],
    ids=lambda value: {True: "serial", False: "tcp"}[value] if isinstance(value, bool) else str(value),
)
async def test_a_plain_gripper_is_as_assumed_in_every_stage(serial: bool, model: Model, last: int) -> None:
    """Every stage on each kind of link. The 2F-85: with physics, and replayed."""
    # As often as in earnest once, up to the strokes of the quickest gripper, which are over in 0.5 s.
    lengths = replace(SHORT, interval=None) if model is HAND_E else SHORT
    async with served(serial=serial, model=model) as server:
        helper, roll = Helper(server), Roll()
        report = await verified(server, helper, roll, last=last, lengths=lengths)
        assert_as_assumed(report)
        assert report.stages == roll.stages == list(range(last + 1))
        assert not helper.alarms
        assert not server.gripper.is_moving
