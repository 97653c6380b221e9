"""The contract on grippers whose axes bodies move. The 2F-140 and the Hand-E keep it as the 2F-85 does.

What cannot pass: scenes that put an obstacle at a count, for with physics parts have places and sizes; and
those that are about a 3-Finger, as on any sibling (tests/test_models.py).

A scene takes ten times as long as without bodies. So it is tried in one form, for the forms differ in what
the hand does; with three fingers motions are; and streams, waits, loops and units are left out, for they are
made of statuses, wherever these come from.
"""

from __future__ import annotations

import re

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests.contract.bench import MODEL, OTHERWISE, PHYSICS
from tests.verify.test_contract import ASKING, scenes

OF_FINGERS = ("test_grasping", "test_moves")
"""Where it matters how many axes the bodies move."""
OF_STATUSES = ("test_amounts", "test_loops", "test_observation", "test_streams", "test_waiting")
ELSEWHERE = re.compile("axes of a|axis of a|not obstacles at a count")


@pytest.mark.parametrize(
    ("kind", "file"),
    [(TWO_FINGER_85, file) for file in ASKING if file not in OF_STATUSES]
    + [(THREE_FINGER, file) for file in OF_FINGERS],
    ids=str,
)
def test_bodies_keep_the_contract(kind: Model, file: str) -> None:
    model, physics = MODEL.set(kind), PHYSICS.set(True)
    failed, kept = set(), 0
    try:
        for name, scene in dict(scenes(file)).items():
            try:
                scene()
                kept += 1
            except Exception as error:  # noqa: BLE001  # every way to fail counts
                if not ELSEWHERE.search(str(error)):
                    failed.add(name)
    finally:
        MODEL.reset(model)
        PHYSICS.reset(physics)
    assert failed <= (OTHERWISE.keys() if kind is TWO_FINGER_85 else set())
    assert kept > 0
