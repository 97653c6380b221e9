"""A whole run of verify against grippers whose axes bodies move: all is as assumed, but for the soft part."""

from __future__ import annotations

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async.simulator import Physics
from robotiq_async.tools.verify import Verdict
from robotiq_async.tools.verify.stages import soft_part
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests.verify.people import Helper, Roll, served, verified

pytestmark = pytest.mark.virtual_time


@pytest.mark.parametrize(("model", "last"), [(THREE_FINGER, 6), (TWO_FINGER_85, 9)], ids=str)
async def test_every_stage_ends_well_but_the_one_with_foam(model: Model, last: int) -> None:
    """Bodies are rigid: there is no foam among them. Strokes of the other jaws: test_mechanics.

    From the activation on: nothing moves before. Four chains of bodies take three times as long as one jaw,
    and in a loss and a soak only one of them moves.
    """
    async with served(model=model, physics=Physics("table")) as server:
        helper = Helper(server)
        helper.before = lambda words: True if words in (soft_part.PLACE, soft_part.RELEASE) else None
        report = await verified(server, helper, Roll(), first=3, last=last)
    assert report.why == "done", report.words
    assert report.stages == list(range(3, last + 1))
    other = {each for each, check in report.checks.items() if check.verdict is not Verdict.AS_ASSUMED}
    assert {each for each in other if not each.startswith("soft.")} == set()
    assert not helper.alarms
