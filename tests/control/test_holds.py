"""Holds that a caller asks for: what moves stays where it is, what grips keeps its grip."""

from __future__ import annotations

import pytest

from robotiq_async import Finger, MoveSupersededError, ObjectStatus, State
from tests.control.scan import Scan, started
from tests.control.stories import tell

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

STORIES = {
    "it is told when it is acknowledged": "started, move A 200, run 0.5, note, hold, state RUNNING_CC, step, "
    "written 1, 2 told, state RUNNING_IDLE, run 1, written 1",
    "where nothing moves nothing is written": "started, moved ABC 100, run 0.5, note, hold, step, written 0, "
    "2 told, state RUNNING_IDLE",
    "a motion that was written and does not act yet": "started 0.2, note, command A 200, step, hold A, "
    "run 2, 2 told, A went 4",
    "what was not sent yet is dropped": "started, note, command A 200, command B 100, hold A, 1 superseded, "
    "until told 3, run 2, 2 told, A went 1, B at 100",
    "a command after it moves again": "started, move A 200, run 0.5, hold A, moved A 220, 2 told, A at 220",
    "a halt does for whoever waits for a hold": "started, move A 200, run 0.5, hold A, halt, "
    "until told 3 0.6, 2 told, rests",
    "after a halt it is told too": "started, move A 200, run 0.5, halt, hold A, until told 3 0.6, "
    "until told 2 0.6, rests",
    "what another client moves is held too": "adopted, hold A, until told 1 0.6, note, run 2, A went 1, "
    "B goes",
    "it survives that another client takes over": "started, move A 255 speed=0, run 0.5, hold A, theirs 200, "
    "run 0.02, until told 2 0.6, note, run 2, A went 1",
    **{
        f"in an activation it does nothing: {begun}": f"new, connect, note, {begun}, hold, 1 told, "
        "until state RUNNING_IDLE, written 1"
        for begun in ("activate", "activate, run 0.025")
    },
    "in a release it does nothing": "started, moved ABC 200, inject 14, step, release, step, note, hold, "
    "2 told, until state ATR_DONE 60, hold, 3 told, run 0.1, written 0",
    "it is told in a fault": "started, move A 200, run 0.5, inject 12 1, see, state FAULT, hold A, "
    "until told 2 0.6, 2 told, note, run 3, A went 2",
    "also when it was asked for before": "started, move A 200, run 0.5, hold A, inject 12 1, see, "
    "state FAULT, until told 2 0.6, 2 told, note, run 3, A went 2",
    **{
        f"it is made good after {how}": f"started, move A 255 speed=0, run 0.5, hold A, {how}, 2 lost, "
        "back 0.5, run 0.5, note, run 2, A went 1"
        for how in ("lose", "step unanswered")
    },
    "a reset takes over": "started, move A 255, run 0.5, hold A, reset, 2 superseded",
    "a gripper that lost its activation is not written to": "started, move A 255, run 0.5, note, hold A, "
    "power-cycle, run 0.5, 2 inactive, written 0",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


@pytest.mark.parametrize("device_cycle", [0.0, 0.005, 0.03, 0.2])
def test_axes_that_move_are_held_and_their_moves_end(device_cycle: float) -> None:
    scan = started(device_cycle)
    _, held = scan.move(200, A)
    _, other = scan.move(200, B)
    scan.run(0.5)
    at = scan.positions()[A]
    asked = scan.hold(A)
    assert isinstance(held.error, MoveSupersededError)
    scan.until(lambda: asked.is_told, 0.6)
    assert asked.told == [None]
    scan.until(lambda: other.is_told)
    assert other.result.positions[B] == 200
    assert scan.positions()[A] <= at + 1 + 30 * device_cycle
    assert scan.state is State.RUNNING_IDLE


def test_a_grip_is_kept_and_an_axis_at_rest_is_left_alone(scan: Scan) -> None:
    scan.gripper.place_object(A, 60)
    scan.moved(255, A)
    scan.moved(90, B)
    scan.move(200, C)
    scan.run(0.5)
    before = scan.last_image
    scan.hold()
    scan.run(0.5)
    held = scan.last_image
    assert held == before.with_positions({C: held.position(C)})
    assert held.position(C) < 200
    assert scan.latest.finger_status(A) is ObjectStatus.CONTACT_CLOSING
