"""Awaited moves: when they end, what takes them over, and what becomes of one that is not awaited."""

from __future__ import annotations

import pytest

from robotiq_async import Finger, ObjectStatus
from tests.control.scan import POLL_S, Scan, started
from tests.control.stories import tell

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

STORIES = {
    **{
        f"there and back quickly, cycle {cycle}": f"started {cycle}, moved A 100 speed=255, command A 200, "
        f"step, moved A 100, run {2 * cycle}, rests, A at 100"
        for cycle in (0.005, 0.02, 0.2)
    },
    "speed and force do not supersede": "started, move A 255 speed=0, run 0.5, command A speed=255 force=3, "
    "until told 1 3, A at 241",
    "superseded for one axis, the others run on": "started, move AB 255, run 0.5, command A 0, 1 superseded, "
    "until still, B at 241, A at 6",
    # Abandoned: cancelled, timed out.
    "it is held where it is, and no caller waits for it": "started, move AB 255, run 1, note, abandon 1, "
    "no moves, run 2, rests, A went 3",
    "the others are left alone": "started, move A 255, move B 255, run 0.5, abandon 1, until told 2, "
    "B at 241",
    "an axis in contact keeps its request and its grip": "started, place A 60, move AB 255, until A closing, "
    "note, abandon 1, run 1, A asked 255, A closing, rests, B went 3",
    "before it was sent it is dropped": "started, note, move A 255, abandon 1, run 0.1, written 0, "
    "state RUNNING_IDLE",
    "the motion it had superseded is held": "started, move A 255, run 0.5, move A 100, abandon 2, note, "
    "run 1, rests, A went 3",
    "before it was sent it leaves a grip": "started, place A 60, moved A 255, note, move A 0, abandon 2, "
    "run 0.5, written 0, A closing",
    **{
        f"{steps} steps after it began": f"started 0.02, note, move A 255 speed=255, run {steps * POLL_S}, "
        "abandon 1, run 1, rests, A went 9"
        for steps in range(1, 8)
    },
    "superseded before, it holds nothing": "started, move A 255, run 0.3, move A 200, 1 superseded, "
    "abandon 1, until told 2, A at 200",
    "who waits for a position that it took over is told": "started, note, command A 50, command B 70, "
    "move A 100, abandon 3, run 1, 1 superseded, 2 told, A went 4, until still, B at 70",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


def test_a_move_ends_when_every_addressed_axis_has_stopped(scan: Scan) -> None:
    result = scan.moved(255, speed=255)
    assert result.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert all(position >= 240 for position in result.positions.values())
    assert not result.object_detected
    assert result.duration == pytest.approx(2.12, abs=0.03)
    assert set(result.peak_current_ma) == {A, B, C}
    assert min(result.peak_current_ma.values()) > 0


def test_repeating_a_request_does_not_return_the_previous_result(scan: Scan) -> None:
    scan.moved(200, A, speed=255)
    scan.moved(100, A, speed=255)
    result = scan.moved(200, A, speed=255)
    assert result.duration > 0.5
    assert result.positions[A] == pytest.approx(200, abs=2)


def test_a_repeated_request_ends_at_once(scan: Scan) -> None:
    scan.moved(200, A)
    assert scan.moved(200, A).duration <= 2 * POLL_S


def test_more_force_on_a_held_object_is_given_time_to_act(scan: Scan) -> None:
    scan.gripper.place_object(A, 150)
    scan.moved(255, A, force=10)
    result = scan.moved(255, A, force=200)
    assert result.contacts == A
    assert result.duration >= 0.05


def test_more_force_is_waited_for_also_on_a_slow_device() -> None:
    scan = started(device_cycle=0.1)
    scan.gripper.place_object(A, 150, soft=50)
    scan.moved(255, A, force=0)
    result = scan.moved(255, A, force=255)
    scan.run(3)
    assert abs(result.positions[A] - scan.positions()[A]) <= 2


def test_a_move_ends_although_another_axis_is_commanded_at_every_poll(scan: Scan) -> None:
    _, outcome = scan.move(200, A, speed=255)
    for value in range(2000):
        if outcome.is_told:
            break
        scan.command(S, position=value % 200)
        scan.step()
    assert outcome.result.positions[A] == pytest.approx(200, abs=2)
