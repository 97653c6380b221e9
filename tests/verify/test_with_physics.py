"""A whole run of verify against grippers whose axes bodies move: all is as assumed, but for the soft part."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async.hands.options import units_of
from robotiq_async.simulator import Habits, Physics, SimulatedGripper
from robotiq_async.tools.verify import CheckVerdict
from robotiq_async.tools.verify.stages import soft_part
from robotiq_async.tools.verify.stages.full_strokes import SPEED_SHARE
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.verify.people import Helper, Roll, served, verified


@pytest.mark.virtual_time
@pytest.mark.parametrize(("model", "last"), [(THREE_FINGER, 5), (TWO_FINGER_85, 9)], ids=str)
async def test_every_stage_ends_well_but_the_one_with_foam(model: Model, last: int) -> None:
    """Bodies are rigid: there is no foam among them. Strokes of the other jaws: test_mechanics.

    From the activation on: nothing moves before. Four chains of bodies take three times as long as one jaw:
    their strokes are below, and in a loss and a soak only one of them moves.
    """
    async with served(model=model, physics=Physics("table")) as server:
        helper = Helper(server)
        helper.before = {soft_part.PLACE: True, soft_part.RELEASE: True, soft_part.AGAIN: "s"}.get
        report = await verified(server, helper, Roll(), first=3, last=last)
    assert report.why == "done", report.words
    assert report.stages == list(range(3, last + 1))
    other = {each for each, check in report.checks.items() if check.verdict is not CheckVerdict.AS_ASSUMED}
    assert {each for each in other if not each.startswith("soft.")} == set()
    assert not helper.alarms


def test_a_stroke_of_three_fingers_and_of_the_scissor_is_as_assumed() -> None:
    """The stage of full strokes, at one speed and without its waits."""
    now = 0.0
    habits = Habits(activation_time=0)
    gripper = SimulatedGripper(lambda: now, habits=habits, physics=Physics("table"))

    def moved(fingers: int, scissor: int) -> tuple[RobotiqStatus, float]:
        """The status after a motion, and the seconds that it took."""
        nonlocal now
        axes = (AxisRequest(fingers, 255),) * 3 + (AxisRequest(scissor, 255),)
        began = now
        gripper.write(0, Request(activate=True, go=began > 0, axes=axes).registers)
        while True:
            now += 0.02
            status = RobotiqStatus.from_registers(gripper.status_registers())
            if status.is_activated and not (status.go_echo and status.moving):
                return status, now - began
            assert now - began < 10, "it ends"

    moved(0, 128)
    opened, _ = moved(0, 128)
    closed, took = moved(255, 128)
    assert took == pytest.approx(units_of(None, None, THREE_FINGER).closing_s(255), rel=SPEED_SHARE)
    fingers = [axis for axis in THREE_FINGER.axes if axis in Finger.ABC]
    usual = range(THREE_FINGER.stroke.open_reading, THREE_FINGER.open_reading_max + 1)
    assert all(opened.position(axis) in usual for axis in fingers)
    assert all(closed.position(axis) >= THREE_FINGER.closed_reading_min for axis in fingers)
    moved(0, 128)
    spread = [moved(0, goal)[0] for goal in (0, 255)]
    assert [status.requested_position(Finger.SCISSOR) for status in spread] == [0, 255]
    assert [status.position(Finger.SCISSOR) for status in spread] == [15, 232]
