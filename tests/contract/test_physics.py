"""The contract on grippers whose axes bodies move.

What cannot pass: scenes with an obstacle at a count, for with physics parts have places and sizes; and those
about a 3-Finger, on a jaw as on any jaw (``OTHERWISE``). Grips of parts stand below instead.

A scene takes ten times as long as without bodies. So it is tried in one form, for the forms differ in what
the hand does. The 2F-85 has every scene in which something moves. The others share all code with it but for
the bodies: they have those whose outcome depends on where the fingers are and on how far they go. Streams,
waits, loops and units are made of statuses, wherever these come from.
"""

from __future__ import annotations

import asyncio
import inspect
import re
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async import Finger, GripChange, GripEvent, Stream
from robotiq_async.hand import Hand
from robotiq_async.values.model import HAND_E, MODELS, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from tests.contract.bench import LOCAL, MODEL, OTHERWISE, PHYSICS, Bench, bench
from tests.verify.test_contract import ASKING, scenes
from tests.virtual import inside

GAINED, SLIPPED, LOST, RELEASED = GripChange
OF_STATUSES = (
    "test_amounts",
    "test_grasping",
    "test_loops",
    "test_observation",
    "test_streams",
    "test_waiting",
)
TRIED: dict[Model, list[str]] = {
    TWO_FINGER_85: [file for file in ASKING if file not in OF_STATUSES],
    TWO_FINGER_140: ["test_amounts", "test_faults", "test_moves"],
    HAND_E: ["test_amounts", "test_faults", "test_moves"],
    THREE_FINGER: ["test_grasping", "test_moves"],
}
OBSTACLE = "place_object("
"""What a scene with an obstacle at a count calls."""


@pytest.mark.parametrize(("kind", "file"), [(kind, file) for kind in TRIED for file in TRIED[kind]], ids=str)
def test_bodies_keep_the_contract(kind: Model, file: str) -> None:
    model, physics = MODEL.set(kind), PHYSICS.set("table")
    failed, kept = set(), 0
    try:
        for name, scene in dict(scenes(file)).items():
            if OBSTACLE in inspect.getsource(scene.func):
                continue
            try:
                scene()
                kept += 1
            except Exception as error:  # noqa: BLE001  # every way to fail counts
                if not re.search("axes of a|axis of a", str(error)):
                    failed.add(name)
    finally:
        MODEL.reset(model)
        PHYSICS.reset(physics)
    assert failed <= (set() if kind is THREE_FINGER else OTHERWISE.keys())
    assert kept > 0


# -- a part ------------------------------------------------------------------------------------------------


@asynccontextmanager
async def around_a_part(kind: Model) -> AsyncIterator[Bench]:
    """A gripper that is active and open, with a box between its fingers."""
    MODEL.set(kind)
    PHYSICS.set("box:60x60x60,0.3" if kind is THREE_FINGER else "box:30x40x60,0.3")
    async with bench(LOCAL) as here:
        yield here


async def each_finger(kind: Model, events: Stream[GripEvent], *changes: GripChange) -> None:
    """Hear of these changes from each finger: soon, or not at all."""
    wanted = {(finger, change) for finger in fingers_of(kind) for change in changes}
    async with asyncio.timeout(20):
        heard = [await anext(events) for _ in wanted]
    assert {(event.finger, event.change) for event in heard} == wanted


def fingers_of(kind: Model) -> list[Finger]:
    return [axis for axis in kind.axes if axis is not Finger.SCISSOR]


@pytest.mark.parametrize("kind", MODELS.values(), ids=str)
@inside(around_a_part, "kind")
async def test_a_part_is_gripped_let_go_and_lost(kind: Model, here: Bench, hand: Hand) -> None:
    events = hand.grip_events()
    grasp = await hand.grasp(speed=200, force=30)
    assert grasp.is_held
    assert grasp.at_least == len(fingers_of(kind))
    assert set(grasp.positions) == set(fingers_of(kind))
    await each_finger(kind, events, GAINED)
    if kind is HAND_E:  # whose opening is linear in counts
        assert grasp.width_mm == pytest.approx(30, abs=0.7)
    await hand.open()
    assert hand.part is None
    await each_finger(kind, events, RELEASED)
    assert await hand.grasp(force=30)
    await each_finger(kind, events, GAINED)
    await hand.reset()
    await each_finger(kind, events, LOST)
    await hand.activate()
    assert await hand.grasp(), "an activation takes the part out, and puts it back"


@pytest.mark.parametrize("kind", MODELS.values(), ids=str)
@inside(around_a_part, "kind")
async def test_a_part_that_is_taken_away(kind: Model, here: Bench, hand: Hand) -> None:
    """A jaw moves on, and its object status changes; a finger of a 3-Finger stays until it presses again."""
    grasp = await hand.grasp(force=30)
    events = hand.grip_events(since=grasp.status)
    assert here.physics is not None
    here.physics.take_away()
    await asyncio.sleep(1)
    if kind is THREE_FINGER:
        assert [*events.drain()] == [], "the contact latches"
        await hand.set_force(60)
    await each_finger(kind, events, SLIPPED, LOST)
    assert not await hand.grasp(force=61)
