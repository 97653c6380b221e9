"""The end that keeps a grip: rGTO stays set where everything is at rest, and on any doubt it is cleared."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest

from robotiq_async import Fault, Finger, NotStartedError, RobotiqStatus
from robotiq_async.control.stops import KEEP_S, REST_S
from robotiq_async.values.enums import StopLevel
from tests.control.other_client import image
from tests.control.scan import POLL_S, Scan, started
from tests.grippers import Restless

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR
CYCLES = pytest.mark.parametrize("device_cycle", [0.0, 0.005, 0.03, 0.2])


def holding(device_cycle: float = 0.005) -> Scan:
    """B and C hold something at 150."""
    scan = started(device_cycle)
    scan.gripper.place_object(B | C, 150)
    scan.moved(255, B | C, speed=255)
    return scan


def stopped(scan: Scan) -> float:
    """Stop it, keeping the grip; returns the seconds that took. Whatever happens, nothing moves on."""
    began = scan.now
    scan.stop(keep_grip=True)
    took = scan.now - began
    before = scan.travels()
    scan.now += 10
    assert scan.travels() == before, "something went on"
    return took


# -- kept --------------------------------------------------------------------------------------------------


@CYCLES
def test_a_grip_is_kept_and_nothing_is_written(device_cycle: float) -> None:
    scan = holding(device_cycle)
    writes = len(scan.written)
    took = stopped(scan)
    assert len(scan.written) == writes
    assert scan.gripper.grips == B | C
    assert REST_S <= took < REST_S + 3 * POLL_S


@CYCLES
def test_moving_axes_are_held_and_the_grip_is_kept(device_cycle: float) -> None:
    scan = holding(device_cycle)
    _, moving = scan.move(255, A, speed=0)
    scan.run(0.6)
    at, writes = scan.gripper.position(A), len(scan.written)
    took = stopped(scan)
    assert isinstance(moving.error, NotStartedError)
    assert len(scan.written) == writes + 1, "a hold is written once"
    assert -2 <= scan.gripper.position(A) - at <= 2 + 24 * device_cycle
    assert scan.gripper.grips == B | C
    assert took < KEEP_S + 0.3


@pytest.mark.parametrize("speed", [0, 255])
@CYCLES
def test_an_axis_that_has_not_begun_yet_never_gets_far(device_cycle: float, speed: int) -> None:
    scan = holding(device_cycle)
    scan.command(A, position=200, speed=speed)
    scan.step()
    stopped(scan)
    assert scan.gripper.position(A) < 40
    assert scan.gripper.grips == B | C


def test_a_command_that_was_not_sent_is_dropped() -> None:
    scan = holding()
    command = scan.command(A, position=200)
    writes = len(scan.written)
    stopped(scan)
    assert isinstance(command.error, NotStartedError)
    assert len(scan.written) == writes
    assert scan.gripper.grips == B | C


def test_a_finger_that_closes_is_held_and_those_that_hold_already_go_on() -> None:
    scan = started()
    scan.gripper.place_object(B, 40)
    scan.gripper.place_object(A | C, 200)
    scan.move(255, A | B | C)
    scan.until(lambda: B in scan.latest.contacts)
    stopped(scan)
    assert scan.gripper.grips == B
    assert scan.gripper.position(A) < 100


def test_a_change_without_an_echo_is_given_the_time_to_act() -> None:
    scan = holding()
    scan.command(B | C, force=0)
    scan.step()
    assert stopped(scan) > 0.25
    assert scan.gripper.grips == B | C


def test_fingers_that_press_again_are_held_like_all_that_moves() -> None:
    """More force makes them try again, and deeper into something soft."""
    scan = holding()
    scan.gripper.place_object(B | C, 150, soft=40)
    scan.command(B | C, force=255)
    scan.run(0.05)
    assert scan.gripper.is_moving
    stopped(scan)
    assert scan.gripper.position(B) < 170


def test_an_adopted_grip_is_kept_without_a_write() -> None:
    scan = Scan(after=holding())
    scan.connect()
    stopped(scan)
    assert not scan.written
    assert scan.gripper.grips == B | C


def test_a_link_that_was_lost_some_time_ago_is_no_doubt() -> None:
    scan = holding()
    scan.blink()
    scan.run(1.0)
    stopped(scan)
    assert scan.gripper.grips == B | C


def test_where_rgto_is_clear_there_is_nothing_to_keep_and_nothing_to_say(
    caplog: pytest.LogCaptureFixture,
) -> None:
    scan = holding()
    scan.halted()
    writes = len(scan.written)
    stopped(scan)
    assert len(scan.written) == writes
    assert not scan.gripper.grips
    assert not caplog.records


# -- not kept ----------------------------------------------------------------------------------------------


def fault(scan: Scan) -> None:
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 5.0)
    scan.run(0.1)


def fault_at_last(scan: Scan) -> None:
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)


def action_waits(scan: Scan) -> None:
    scan.gripper.inject_fault(Fault.MODE_CHANGE_PENDING)
    scan.run(0.1)


def link_down(scan: Scan) -> None:
    scan.controller.lost(None)
    scan.now += 0.01


def link_just_back(scan: Scan) -> None:
    scan.command(S, position=100)
    scan.step(answer=False)
    scan.connect(activate=False)


def halt_asked(scan: Scan) -> None:
    scan.halt()


def reset_begun(scan: Scan) -> None:
    scan.controller.reset()


def other_client(scan: Scan) -> None:
    scan.gripper.write(0, image({A: 90, B: 255, C: 255, S: 60}))
    scan.now += 0.02


def mode_change(scan: Scan) -> None:
    scan.gripper.write(0, [0x0B00])  # another client's: simple control, the pinch mode
    scan.now += 0.02


@pytest.mark.parametrize(
    ("trouble", "why"),
    [
        (fault, "in FAULT"),
        (fault_at_last, "interference on the scissor"),
        (action_waits, "mode change"),
        (link_down, "in DISCONNECTED"),
        (link_just_back, "not known for certain"),
        (halt_asked, "halt"),
        (reset_begun, "in DO_RESET"),
        (other_client, "another client"),
        (mode_change, "activating"),
    ],
    ids=lambda value: getattr(value, "__name__", ""),
)
def test_on_any_doubt_rgto_is_cleared_and_a_word_says_why(
    trouble: Callable[[Scan], None], why: str, caplog: pytest.LogCaptureFixture
) -> None:
    scan = holding()
    trouble(scan)
    caplog.clear()
    stopped(scan)
    assert not scan.last_image.go
    assert scan.last_image.activate
    assert not scan.status().go_echo
    (said,) = [each for each in caplog.messages if "no grip is kept" in each]
    assert why in said


def test_another_client_seen_between_the_call_and_the_stop_is_a_doubt(
    caplog: pytest.LogCaptureFixture,
) -> None:
    """By the read that was on the line as the hand was stopped."""
    scan = holding()
    scan.controller.refuse_requests()
    other_client(scan)
    scan.see()
    scan.controller.stop_fingers(StopLevel.KEEP)
    scan.until(lambda: not scan.controller.is_busy, 1.0)
    assert not scan.status().go_echo
    assert "no grip is kept: another client" in caplog.text


def test_a_link_that_goes_down_meanwhile_is_a_doubt() -> None:
    scan = holding()
    scan.controller.refuse_requests()
    scan.controller.stop_fingers(StopLevel.KEEP)
    scan.step()
    scan.controller.lost(None)
    scan.see()
    scan.controller.stop_fingers(StopLevel.KEEP)
    scan.until(lambda: not scan.controller.is_busy, 1.0)
    assert not scan.gripper.grips
    assert not scan.last_image.go


def test_replies_that_were_looked_at_late_tell_of_no_rest(caplog: pytest.LogCaptureFixture) -> None:
    """The loop was held up: they are as old as their requests."""
    scan = holding()
    scan.controller.refuse_requests()
    scan.controller.stop_fingers(StopLevel.KEEP)
    images = []
    for late in (0.0, 0.3, 0.3, 0.6):
        status = scan.status()
        at = scan.now + late
        scan.controller.see(RobotiqStatus(status.registers, at, status.sequence), scan.now)
        images.append(scan.controller.decide(at))
        assert scan.controller.is_busy
        scan.now += POLL_S
    assert images[:3] == [None] * 3
    assert images[3] is not None
    assert not images[3].go
    assert "the newest status is old" in caplog.text


def test_an_activation_of_ours_is_still_taken_back() -> None:
    scan = Scan()
    scan.connect()
    scan.run(1.0)
    stopped(scan)
    assert not scan.last_image.activate


def test_a_hold_that_activates_a_gripper_reset_by_another_client_is_taken_back() -> None:
    """Clearing rGTO ends no activation: the fingers went to their stops after the hand had ended."""
    scan = started()
    scan.move(255, speed=0)
    scan.run(0.5)
    scan.controller.refuse_requests()
    scan.controller.stop_fingers(StopLevel.KEEP)
    scan.gripper.write(0, [0x0000])
    scan.now += 0.006
    scan.hurry()
    assert scan.last_image.activate, "the hold has crossed the reset"
    scan.until(lambda: not scan.controller.is_busy, 1.0)
    before = scan.travels()
    scan.now += 20
    assert not scan.status().activation_echo
    assert scan.travels() == before


def test_axes_that_do_not_come_to_rest_are_stopped_in_time(caplog: pytest.LogCaptureFixture) -> None:
    scan = Scan()
    scan.gripper = Restless(lambda: scan.now, device_cycle=0.2)
    scan.start()
    scan.command(A, position=100)
    scan.run(5)
    took = stopped(scan)
    assert not scan.last_image.go
    assert "not every axis came to rest" in caplog.text
    assert KEEP_S < took < KEEP_S + 0.5
    assert [record.levelno for record in caplog.records] == [logging.WARNING]
