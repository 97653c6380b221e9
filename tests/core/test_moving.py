"""Moves, commands and halts: what is written, what moves, what callers are told."""

from __future__ import annotations

import pytest

from robotiq_async import Finger, MoveSupersededError, ObjectStatus, State
from robotiq_async.wire.request import Request
from tests.bench import POLL_S, Bench

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.start()
    return bench


def last(bench: Bench) -> Request:
    return Request.from_registers(bench.written[-1])


def test_activation_from_reset_goes_through_its_states_and_never_shows_reset(bench: Bench) -> None:
    assert [target for _, target, _ in bench.transitions] == [
        State.DO_ACTIVATION,
        State.WF_ACTIVATION,
        State.RUNNING_IDLE,
    ]
    assert last(bench).go is False


def test_a_move_ends_when_every_addressed_axis_has_stopped(bench: Bench) -> None:
    result = bench.moved(255, speed=255)
    assert result.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert all(position >= 240 for position in result.positions.values())
    assert not result.object_detected
    assert result.duration == pytest.approx(2.12, abs=0.03)
    assert set(result.peak_current_ma) == {A, B, C}
    assert min(result.peak_current_ma.values()) > 0


def test_the_first_command_after_an_activation_moves_only_what_it_addresses(bench: Bench) -> None:
    before = {axis: bench.gripper.travel(axis) for axis in (B, C, S)}
    bench.moved(200, A)
    assert {axis: bench.gripper.travel(axis) for axis in (B, C, S)} == before


def test_a_contact_is_a_result(bench: Bench) -> None:
    bench.gripper.place_object(A | B, 150)
    result = bench.moved(255)
    assert result.contacts == A | B
    assert result.object_detected
    assert result.outcomes[A] is ObjectStatus.CONTACT_CLOSING
    assert result.outcomes[C] is ObjectStatus.AT_POSITION
    assert result.positions[A] == pytest.approx(150, abs=1)


def test_repeating_a_request_does_not_return_the_previous_result(bench: Bench) -> None:
    bench.moved(200, A, speed=255)
    bench.moved(100, A, speed=255)
    result = bench.moved(200, A, speed=255)
    assert result.duration > 0.5
    assert result.positions[A] == pytest.approx(200, abs=2)


def test_a_repeated_request_ends_at_once(bench: Bench) -> None:
    bench.moved(200, A)
    assert bench.moved(200, A).duration <= 2 * POLL_S


def test_more_force_on_a_held_object_is_given_time_to_act(bench: Bench) -> None:
    bench.gripper.place_object(A, 150)
    bench.moved(255, A, force=10)
    result = bench.moved(255, A, force=200)
    assert result.contacts == A
    assert result.duration >= 0.05


@pytest.mark.parametrize("device_cycle", [0.005, 0.02, 0.2])
def test_going_there_and_back_quickly_ends_only_when_the_device_has_seen_it(device_cycle: float) -> None:
    bench = Bench(device_cycle=device_cycle)
    bench.start()
    bench.moved(100, A, speed=255)
    bench.command(A, position=200)
    bench.step()
    _, outcome = bench.move(100, A)
    bench.until(lambda: outcome.is_told)
    bench.run(2 * device_cycle)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) == pytest.approx(100, abs=2)


def test_what_is_set_between_two_polls_is_one_write_and_the_last_value_wins(bench: Bench) -> None:
    writes = len(bench.written)
    told = [bench.command(A, position=value) for value in (10, 20, 30)]
    told.append(bench.command(B, speed=7))
    told.append(bench.command(C, force=9))
    bench.step()
    assert len(bench.written) == writes + 1
    image = last(bench)
    assert (image.position(A), image.axes[1].speed, image.axes[2].force) == (30, 7, 9)
    assert [outcome.told for outcome in told] == [[None]] * 5


def test_speed_and_force_never_start_a_motion(bench: Bench) -> None:
    travel = {axis: bench.gripper.travel(axis) for axis in (A, B, C, S)}
    bench.command(Finger.ALL, speed=255, force=255)
    bench.run(1.0)
    assert {axis: bench.gripper.travel(axis) for axis in (A, B, C, S)} == travel


def test_speed_and_force_do_not_supersede_a_move(bench: Bench) -> None:
    _, outcome = bench.move(255, A, speed=0)
    bench.run(0.5)
    bench.command(A, speed=255, force=3)
    assert bench.until(lambda: outcome.is_told) < 3
    assert outcome.result.outcomes[A] is ObjectStatus.AT_POSITION


def test_another_command_supersedes_a_move_whose_other_axes_run_on(bench: Bench) -> None:
    _, outcome = bench.move(255, A | B)
    bench.run(0.5)
    bench.command(A, position=0)
    assert isinstance(outcome.error, MoveSupersededError)
    bench.until(lambda: not bench.controller.is_moving)
    assert bench.gripper.position(B) >= 240
    assert bench.gripper.position(A) <= 7


def test_moves_of_other_axes_go_on_side_by_side(bench: Bench) -> None:
    _, first = bench.move(255, A)
    bench.run(0.3)
    _, second = bench.move(100, B)
    bench.until(lambda: first.is_told and second.is_told)
    assert first.result.positions[A] >= 240
    assert second.result.positions[B] == pytest.approx(100, abs=2)


def test_a_move_ends_although_another_axis_is_commanded_at_every_poll(bench: Bench) -> None:
    _, outcome = bench.move(200, A, speed=255)
    for value in range(2000):
        if outcome.is_told:
            break
        bench.command(S, position=value % 200)
        bench.step()
    assert outcome.result.positions[A] == pytest.approx(200, abs=2)


def test_is_moving_from_the_command_until_the_end(bench: Bench) -> None:
    outcome = bench.command(A, position=200)
    assert bench.controller.is_moving
    while not outcome.is_told:
        bench.step()
    assert bench.controller.is_moving, "acknowledged, but it does not act yet"
    bench.until(lambda: not bench.controller.is_moving)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) == pytest.approx(200, abs=2)


# -- abandoned moves: cancelled, timed out -----------------------------------------------------------------


def test_an_abandoned_move_is_held_where_it_is(bench: Bench) -> None:
    move, _ = bench.move(255, A | B)
    bench.run(1.0)
    bench.controller.abandon(move)
    at = bench.gripper.position(A)
    bench.run(2.0)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) == pytest.approx(at, abs=3)


def test_an_abandoned_move_leaves_the_others_alone(bench: Bench) -> None:
    move, _ = bench.move(255, A)
    _, other = bench.move(255, B)
    bench.run(0.5)
    bench.controller.abandon(move)
    bench.until(lambda: other.is_told)
    assert other.result.positions[B] >= 240


def test_an_axis_in_contact_keeps_its_request_and_its_grip(bench: Bench) -> None:
    bench.gripper.place_object(A, 60)
    move, _ = bench.move(255, A | B)
    bench.until(lambda: bench.latest.contacts == A)
    bench.controller.abandon(move)
    bench.run(1.0)
    assert last(bench).position(A) == 255
    assert last(bench).position(B) < 240
    assert bench.latest.finger_status(A) is ObjectStatus.CONTACT_CLOSING


def test_a_move_abandoned_before_it_was_sent_is_dropped(bench: Bench) -> None:
    writes = len(bench.written)
    move, _ = bench.move(255, A)
    bench.controller.abandon(move)
    bench.run(0.1)
    assert len(bench.written) == writes
    assert bench.state is State.RUNNING_IDLE


def test_a_move_abandoned_before_it_was_sent_holds_the_motion_it_had_superseded(bench: Bench) -> None:
    bench.move(255, A)
    bench.run(0.5)
    move, _ = bench.move(100, A)
    bench.controller.abandon(move)
    at = bench.gripper.position(A)
    bench.run(1.0)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) == pytest.approx(at, abs=3)


def test_a_move_abandoned_before_it_was_sent_keeps_a_grip(bench: Bench) -> None:
    bench.gripper.place_object(A, 60)
    bench.moved(255, A)
    writes = len(bench.written)
    move, _ = bench.move(0, A)
    bench.controller.abandon(move)
    bench.run(0.5)
    assert len(bench.written) == writes
    assert bench.latest.contacts == A


@pytest.mark.parametrize("steps", range(1, 8))
def test_a_move_abandoned_around_the_moment_it_begins_to_act_is_held(steps: int) -> None:
    bench = Bench(device_cycle=0.02)
    bench.start()
    move, _ = bench.move(255, A, speed=255)
    for _ in range(steps):
        bench.step()
    bench.controller.abandon(move)
    bench.run(1.0)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) < 15


def test_a_superseded_move_that_is_abandoned_later_holds_nothing(bench: Bench) -> None:
    move, outcome = bench.move(255, A)
    bench.run(0.3)
    _, second = bench.move(200, A)
    assert outcome.is_told
    bench.controller.abandon(move)
    bench.until(lambda: second.is_told)
    assert second.result.positions[A] == pytest.approx(200, abs=2)


# -- halt --------------------------------------------------------------------------------------------------


def test_halt_stops_everything_and_ends_moves(bench: Bench) -> None:
    _, outcome = bench.move(255)
    bench.run(0.5)
    halted = bench.halt()
    assert isinstance(outcome.error, MoveSupersededError)
    bench.until(lambda: halted.is_told)
    assert halted.told == [None]
    assert not bench.gripper.is_moving
    assert not bench.latest.go_echo


def test_a_command_after_a_halt_moves_only_its_own_axes(bench: Bench) -> None:
    bench.move(255)
    bench.run(0.5)
    bench.halt()
    _, outcome = bench.move(100, A)
    bench.step()
    bench.step()
    travel = {axis: bench.gripper.travel(axis) for axis in (B, C, S)}
    bench.until(lambda: outcome.is_told)
    bench.run(1.0)
    for axis in (B, C, S):
        assert bench.gripper.travel(axis) - travel[axis] <= 1, axis
    assert bench.gripper.position(A) == pytest.approx(100, abs=2)


def test_a_command_after_a_halt_waits_until_a_slow_gripper_has_stopped() -> None:
    bench = Bench(device_cycle=0.1)
    bench.start()
    bench.move(255, speed=255)
    bench.run(0.5)
    bench.halt()
    _, outcome = bench.move(0, A)
    bench.until(lambda: not bench.latest.go_echo)
    travel = {axis: bench.gripper.travel(axis) for axis in (B, C)}
    bench.until(lambda: outcome.is_told)
    for axis in (B, C):
        assert bench.gripper.travel(axis) - travel[axis] <= 1, axis


def test_a_grip_survives_a_halt_and_a_command_to_another_axis(bench: Bench) -> None:
    bench.gripper.place_object(B, 60)
    bench.moved(255, B)
    bench.halt()
    bench.run(0.1)
    bench.moved(100, A)
    assert last(bench).position(B) == 255
    assert bench.latest.finger_status(B) is ObjectStatus.CONTACT_CLOSING


def test_halt_drops_what_was_not_sent_yet(bench: Bench) -> None:
    asked = bench.command(A, position=200)
    bench.halt()
    assert isinstance(asked.error, MoveSupersededError)
    bench.run(0.5)
    assert bench.gripper.position(A) <= 7


def test_halt_in_reset_has_nothing_to_do() -> None:
    bench = Bench()
    bench.connect(activate=False)
    assert bench.halt().told == [None]
    bench.run(0.05)
    assert not bench.written


def test_the_default_timeout_follows_from_distance_and_speed(bench: Bench) -> None:
    full = bench.controller.move_timeout(241, A, 0)
    assert full == pytest.approx(2 * 10.021 + 2, abs=0.1)
    assert bench.controller.move_timeout(241, A, 255) == pytest.approx(2 * 2.12 + 2, abs=0.1)
    assert bench.controller.move_timeout(6, A, 0) == pytest.approx(2.0, abs=0.1)
