"""The contract on grippers whose axes bodies move.

A scene takes ten times as long as without bodies, and the hand is the same. So one is kept for each thing
that a gripper can be told, and for each way in which that is taken back: what an axis does then is up to
its body. It is tried in one form, for the forms differ in what the hand does. The 2F-85 has them all; other
jaws share its code and have the scenes that go by their sizes; the 3-Finger has those of several axes. Waits,
streams, refusals and lost links are made of statuses, wherever these come from.

With physics parts have places and sizes, and there is no obstacle at a count. Grips of parts stand below.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

pytest.importorskip("mujoco", reason="needs the extra physics")

from robotiq_async import Finger, GripChange, GripEvent, Stream
from robotiq_async.hands import Hand
from robotiq_async.simulator import Habits
from robotiq_async.values.model import HAND_E, MODELS, THREE_FINGER, TWO_FINGER_85, TWO_FINGER_140, Model
from tests.contract.bench import LOCAL, MODEL, PHYSICS, Bench, bench
from tests.verify.test_contract import ASKING, scenes
from tests.virtual import inside

GAINED, SLIPPED, LOST, RELEASED = GripChange
OF_SIZES = ["test_a_move_in_millimetres", "test_too_slow"]
TRIED: dict[Model, list[str]] = {
    TWO_FINGER_85: [
        *OF_SIZES,
        "test_release_reset_activate",
        "test_what_is_not_held_has_no_width",
        "test_a_cancelled_activation_goes_on",
        "test_a_cancelled_start_takes_its_activation_back",
        "test_a_foreign_reset",
        "test_a_halt_during_an_activation_ends_in_reset",
        "test_a_loop_that_commands_at_every_status",
        "test_a_minor_fault_ends_a_move_and_nothing_resumes",
        "test_a_released_gripper_is_left_released",
        "test_an_activation_that_ends_in_a_fault_fails_the_start",
        "test_cancelled_at_any_moment",
        "test_halted",
        "test_nothing_commanded_before_a_halt_comes_after_it",
        "test_reset",
        "test_set_position_returns_when_acknowledged",
        "test_stop_may_leave_the_fingers_to_what_they_do",
        "test_superseded_by_another_client_of_the_gripper",
        "test_the_last_command_wins_over_all_calls",
    ],
    TWO_FINGER_140: OF_SIZES,
    HAND_E: OF_SIZES,
    THREE_FINGER: [
        "test_a_command_moves_only_what_it_addresses",
        "test_a_hold_keeps_axes_where_they_are",
        "test_moves_of_different_axes_do_not_disturb_each_other",
        "test_speed_and_force_start_no_motion",
    ],
}
SCENES = {name: scene for file in ASKING for name, scene in scenes(file)}


@pytest.mark.parametrize(("kind", "name"), [(kind, name) for kind in TRIED for name in TRIED[kind]], ids=str)
def test_bodies_keep_the_contract(kind: Model, name: str) -> None:
    model, physics = MODEL.set(kind), PHYSICS.set("table")
    try:
        SCENES[name]()
    finally:
        MODEL.reset(model)
        PHYSICS.reset(physics)


# -- a part ------------------------------------------------------------------------------------------------


@asynccontextmanager
async def around_a_part(kind: Model) -> AsyncIterator[Bench]:
    """A gripper that is reset, with a box between its open fingers."""
    MODEL.set(kind)
    PHYSICS.set("box:60x60x60,0.3" if kind is THREE_FINGER else "box:30x40x60,0.3")
    async with bench(LOCAL, active=False) as here:
        here.gripper.habits = Habits(activation_time=0)  # no second too many: a box costs steps at rest too
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
    await hand.activate()
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


@pytest.mark.parametrize("kind", [THREE_FINGER, TWO_FINGER_85], ids=str)
@inside(around_a_part, "kind")
async def test_a_part_that_is_taken_away(kind: Model, here: Bench, hand: Hand) -> None:
    """A jaw moves on, and its object status changes; a finger of a 3-Finger stays until it presses again."""
    await hand.activate()
    grasp = await hand.grasp(force=30)
    events = hand.grip_events(since=grasp.status)
    assert here.physics is not None
    here.physics.take_away()
    await asyncio.sleep(0.4)
    if kind is THREE_FINGER:
        assert [*events.drain()] == [], "the contact latches"
        await hand.set_force(60)
    await each_finger(kind, events, SLIPPED, LOST)
    assert not await hand.grasp(force=61)
