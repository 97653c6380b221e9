"""Awaited moves: when they end, what takes them over, and what becomes of one that is not awaited."""

from __future__ import annotations

import pytest

from robotiq_async import Finger, MoveSupersededError, ObjectStatus, State
from robotiq_async.calibration.scales import closing_time
from robotiq_async.control.waiters import Move
from robotiq_async.local.session import usual_time
from robotiq_async.values.request import Request
from tests.control.scan import POLL_S, Outcome, Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_a_move_ends_when_every_addressed_axis_has_stopped(scan: Scan) -> None:
    result = scan.moved(255, speed=255)
    assert result.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert all(position >= 240 for position in result.positions.values())
    assert not result.object_detected
    assert result.duration == pytest.approx(2.12, abs=0.03)
    assert set(result.peak_current_ma) == {A, B, C}
    assert all(result.peak_current_ma.values())


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


@pytest.mark.parametrize("device_cycle", [0.005, 0.02, 0.2])
def test_going_there_and_back_quickly_ends_only_when_the_device_has_seen_it(device_cycle: float) -> None:
    scan = started(device_cycle)
    scan.moved(100, A, speed=255)
    scan.command(A, position=200)
    scan.step()
    _, outcome = scan.move(100, A)
    scan.until(lambda: outcome.is_answered)
    scan.run(2 * device_cycle)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) == pytest.approx(100, abs=2)


def test_a_move_ends_although_another_axis_is_commanded_at_every_poll(scan: Scan) -> None:
    _, outcome = scan.move(200, A, speed=255)
    for value in range(2000):
        if outcome.is_answered:
            break
        scan.command(S, position=value % 200)
        scan.step()
    assert outcome.result.positions[A] == pytest.approx(200, abs=2)


# -- what takes over -------------------------------------------------------------------------------------


def test_speed_and_force_do_not_supersede_a_move(scan: Scan) -> None:
    _, outcome = scan.move(255, A, speed=0)
    scan.run(0.5)
    scan.command(A, speed=255, force=3)
    assert scan.until(lambda: outcome.is_answered) < 3
    assert outcome.result.outcomes[A] is ObjectStatus.AT_POSITION


def test_another_command_supersedes_a_move_whose_other_axes_run_on(scan: Scan) -> None:
    _, outcome = scan.move(255, A | B)
    scan.run(0.5)
    scan.command(A, position=0)
    assert isinstance(outcome.error, MoveSupersededError)
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.gripper.position(B) >= 240
    assert scan.gripper.position(A) <= 7


# -- abandoned: cancelled, timed out ---------------------------------------------------------------------


def test_an_abandoned_move_is_held_where_it_is(scan: Scan) -> None:
    move, _ = scan.move(255, A | B)
    scan.run(1.0)
    scan.controller.abandon(move)
    at = scan.gripper.position(A)
    assert not scan.controller._requests.moves, "no caller waits for it"
    scan.run(2.0)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) == pytest.approx(at, abs=3)


def test_an_abandoned_move_leaves_the_others_alone(scan: Scan) -> None:
    move, _ = scan.move(255, A)
    _, other = scan.move(255, B)
    scan.run(0.5)
    scan.controller.abandon(move)
    scan.until(lambda: other.is_answered)
    assert other.result.positions[B] >= 240


def test_an_axis_in_contact_keeps_its_request_and_its_grip(scan: Scan) -> None:
    scan.gripper.place_object(A, 60)
    move, _ = scan.move(255, A | B)
    scan.until(lambda: scan.latest.contacts == A)
    scan.controller.abandon(move)
    scan.run(1.0)
    assert scan.last_image.position(A) == 255
    assert scan.last_image.position(B) < 240
    assert scan.latest.finger_status(A) is ObjectStatus.CONTACT_CLOSING


def test_a_move_abandoned_before_it_was_sent_is_dropped(scan: Scan) -> None:
    writes = len(scan.written)
    move, _ = scan.move(255, A)
    scan.controller.abandon(move)
    scan.run(0.1)
    assert len(scan.written) == writes
    assert scan.state is State.RUNNING_IDLE


def test_a_move_abandoned_before_it_was_sent_holds_the_motion_it_had_superseded(scan: Scan) -> None:
    scan.move(255, A)
    scan.run(0.5)
    move, _ = scan.move(100, A)
    scan.controller.abandon(move)
    at = scan.gripper.position(A)
    scan.run(1.0)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) == pytest.approx(at, abs=3)


def test_a_move_abandoned_before_it_was_sent_keeps_a_grip(scan: Scan) -> None:
    scan.gripper.place_object(A, 60)
    scan.moved(255, A)
    writes = len(scan.written)
    move, _ = scan.move(0, A)
    scan.controller.abandon(move)
    scan.run(0.5)
    assert len(scan.written) == writes
    assert scan.latest.contacts == A


@pytest.mark.parametrize("steps", range(1, 8))
def test_a_move_abandoned_around_the_moment_it_begins_to_act_is_held(steps: int) -> None:
    scan = started(0.02)
    move, _ = scan.move(255, A, speed=255)
    for _ in range(steps):
        scan.step()
    scan.controller.abandon(move)
    scan.run(1.0)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) < 15


def test_a_superseded_move_that_is_abandoned_later_holds_nothing(scan: Scan) -> None:
    move, outcome = scan.move(255, A)
    scan.run(0.3)
    _, second = scan.move(200, A)
    assert outcome.is_answered
    scan.controller.abandon(move)
    scan.until(lambda: second.is_answered)
    assert second.result.positions[A] == pytest.approx(200, abs=2)


def test_a_pending_position_is_superseded_by_a_move_that_is_then_cancelled(scan: Scan) -> None:
    waiting, other = scan.command(A, position=50), scan.command(B, position=70)
    move, _ = scan.move(100, A)
    scan.controller.abandon(move)
    scan.run(1)
    assert isinstance(waiting.error, MoveSupersededError)
    assert other.answers == [None]
    assert scan.positions()[A] < 10
    scan.until(lambda: not scan.controller.is_moving)
    assert abs(scan.positions()[B] - 70) <= 2


@pytest.mark.parametrize("is_sent", [False, True])
@pytest.mark.parametrize("end", ["abandoned", "halted", "superseded"])
def test_the_speed_and_force_of_a_move_stay_however_it_ends(scan: Scan, end: str, is_sent: bool) -> None:
    """As if it had been written: its caller cannot know which side of the write the end has met."""
    move, _ = scan.move(255, A, speed=7, force=200)
    scan.run(0.1 if is_sent else 0)
    if end == "abandoned":
        scan.controller.abandon(move)
    elif end == "halted":
        scan.halt()
    scan.command(A, position=30)
    scan.run(0.2)
    scan.until(lambda: not scan.controller.is_moving)
    (axis, *_) = scan.last_image.axes
    assert (axis.position, axis.speed, axis.force) == (30, 7, 200)


@pytest.mark.parametrize("slower", [False, True])
def test_the_default_timeout_knows_the_speeds_at_the_call(scan: Scan, slower: bool) -> None:
    """Of this call, of one before it in the same cycle, and none that comes later."""
    fast, slow = (closing_time(speed) for speed in (255, 0))
    scan.command(A, speed=255)
    if slower:
        scan.command(A, speed=0)
    scan.controller.move(Move(255, A, scan.now, Outcome()), None, None)
    limit = usual_time(255, A, scan.latest, scan.controller.speeds, closing_time)
    scan.command(A, speed=0)
    assert limit == pytest.approx(2 * (slow if slower else fast) + 2, rel=0.15)


# -- cancelled in the moment in which they fail: the caller does not see the error ------------------------


def test_of_a_move_that_another_client_ended_the_axes_that_still_follow_it_are_held(scan: Scan) -> None:
    move, outcome = scan.move(255, A | B, speed=0)
    scan.run(0.5)
    ours = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, ours.with_positions({A: 200}).registers)
    scan.until(lambda: outcome.is_answered)
    scan.controller.abandon(move, unseen=True)
    at = scan.positions()
    scan.run(15)
    assert (scan.positions()[A], abs(scan.positions()[B] - at[B]) <= 4) == (200, True)


def test_of_a_move_that_another_client_ended_an_axis_that_was_commanded_since_is_not_held(
    scan: Scan,
) -> None:
    move, outcome = scan.move(255, A | B, speed=0)
    scan.run(0.5)
    ours = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, ours.with_positions({A: 200}).registers)
    scan.until(lambda: outcome.is_answered)
    asking = scan.command(B, position=100)
    scan.controller.abandon(move, unseen=True)
    scan.run(15)
    assert (asking.answers, scan.positions()[B]) == ([None], 100)


def test_a_move_that_was_dropped_goes_on(scan: Scan) -> None:
    move, outcome = scan.move(255, A)
    scan.run(0.5)
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    scan.answer_ended()
    assert isinstance(outcome.error, MoveSupersededError)
    scan.controller.abandon(move, unseen=True)
    scan.run(5)
    assert scan.positions()[A] >= 240
