"""Holds that a caller requests: moving axes stay where they are, gripping axes keep their grip."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    Finger,
    MoveSupersededError,
    NotActivatedError,
    ObjectStatus,
    State,
)
from robotiq_async.values.model import HAND_E, TWO_FINGER_85, Model
from robotiq_async.values.status import RobotiqStatus
from tests.control.other_client import going_to, moved_by_another
from tests.control.scan import Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


@pytest.mark.parametrize("device_cycle", [0.0, 0.005, 0.03, 0.2])
def test_axes_that_move_are_held_and_their_moves_end(device_cycle: float) -> None:
    scan = started(device_cycle)
    _, held = scan.move(200, A)
    _, other = scan.move(200, B)
    scan.run(0.5)
    at = scan.positions()[A]
    asked = scan.hold(A)
    assert isinstance(held.error, MoveSupersededError)
    scan.until(lambda: asked.is_answered, 0.6)
    assert asked.answers == [None]
    scan.until(lambda: other.is_answered)
    assert other.result.positions[B] == 200
    assert scan.positions()[A] <= at + 1 + 65 * device_cycle, "it goes on until the hold acts"
    assert scan.state is State.RUNNING_IDLE


def test_a_hold_ends_when_it_is_acknowledged(scan: Scan) -> None:
    scan.move(200, A)
    scan.run(0.5)
    written = len(scan.written)
    asked = scan.hold()
    assert scan.state is State.RUNNING_CC
    scan.step()
    assert (len(scan.written), asked.answers, scan.state) == (written + 1, [None], State.RUNNING_IDLE)
    scan.run(1.0)
    assert len(scan.written) == written + 1


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


def test_behind_a_halt_nothing_moves_and_nothing_is_written(scan: Scan) -> None:
    scan.move(200)
    scan.run(0.5)
    scan.halted()
    scan.run(0.5)
    written = len(scan.written)
    asked = scan.hold()
    scan.step()
    assert (len(scan.written), asked.answers, scan.state) == (written, [None], State.RUNNING_IDLE)


def test_where_nothing_moves_nothing_is_written(scan: Scan) -> None:
    scan.moved(100)
    scan.run(0.5)
    written = len(scan.written)
    asked = scan.hold()
    scan.step()
    assert (len(scan.written), asked.answers, scan.state) == (written, [None], State.RUNNING_IDLE)


def test_a_motion_that_was_written_and_does_not_act_yet_is_held() -> None:
    scan = started(device_cycle=0.2)
    scan.command(A, position=200)
    scan.step()
    asked = scan.hold(A)
    scan.run(2.0)
    assert asked.answers == [None]
    assert scan.positions()[A] <= 10


def test_a_hold_drops_unsent_positions_of_its_axes(scan: Scan) -> None:
    dropped, other = scan.command(A, position=200), scan.command(B, position=100)
    asked = scan.hold(A)
    assert isinstance(dropped.error, MoveSupersededError)
    scan.until(lambda: asked.is_answered)
    scan.run(2.0)
    assert other.answers == [None]
    assert scan.positions()[A] <= 7
    assert scan.positions()[B] == 100


def test_a_command_after_a_hold_moves_again(scan: Scan) -> None:
    scan.move(200, A)
    scan.run(0.5)
    asked = scan.hold(A)
    again = scan.moved(220, A)
    assert asked.answers == [None]
    assert again.positions[A] == 220


def test_a_halt_also_ends_a_pending_hold(scan: Scan) -> None:
    scan.move(200, A)
    scan.run(0.5)
    asked, halted = scan.hold(A), scan.halt()
    scan.until(lambda: halted.is_answered, 0.6)
    assert asked.answers == [None]
    assert not scan.gripper.is_moving


def test_a_hold_after_a_halt_ends_too(scan: Scan) -> None:
    scan.move(200, A)
    scan.run(0.5)
    halted, asked = scan.halt(), scan.hold(A)
    scan.until(lambda: asked.is_answered, 0.6)
    scan.until(lambda: halted.is_answered, 0.6)
    assert not scan.gripper.is_moving


# -- what another client moves -----------------------------------------------------------------------------


def test_motion_of_another_client_is_held_too() -> None:
    scan = moved_by_another()
    asked = scan.hold(A)
    scan.until(lambda: asked.is_answered, 0.6)
    at = scan.positions()
    scan.run(2.0)
    assert scan.positions()[A] <= at[A] + 1
    assert scan.positions()[B] > at[B] + 5


def test_a_hold_survives_that_another_client_takes_over_before_it_is_written(scan: Scan) -> None:
    scan.move(255, A, speed=0)
    scan.run(0.5)
    asked = scan.hold(A)
    scan.gripper.write(0, going_to(200, speed=0))
    scan.run(0.02)
    scan.until(lambda: asked.is_answered, 0.6)
    at = scan.positions()[A]
    scan.run(2.0)
    assert scan.positions()[A] <= at + 1


# -- states ------------------------------------------------------------------------------------------------


def begun(begin: Callable[[Scan], None]) -> Scan:
    scan = Scan()
    scan.connect(activate=False)
    begin(scan)
    return scan


@pytest.mark.parametrize("steps", [0, 5])
def test_in_an_activation_a_hold_does_nothing(steps: int) -> None:
    scan = begun(lambda scan: scan.controller.activate())
    for _ in range(steps):
        scan.step()
    written = len(scan.written)
    assert scan.hold().answers == [None]
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert len(scan.written) == max(written, 1)


def test_in_a_release_a_hold_does_nothing(scan: Scan) -> None:
    scan.moved(200)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    scan.step()
    written = len(scan.written)
    assert scan.hold().answers == [None]
    scan.until(lambda: scan.state is State.ATR_DONE, 60)
    assert scan.hold().answers == [None]
    scan.run(0.1)
    assert len(scan.written) == written


@pytest.mark.parametrize("when", ["before", "after"])
def test_a_hold_ends_in_a_fault(scan: Scan, when: str) -> None:
    scan.move(200, A)
    scan.run(0.5)
    asked = scan.hold(A) if when == "before" else None
    scan.gripper.inject_fault(Fault(0x0C), 1.0)
    scan.see()
    assert scan.state is State.FAULT
    asked = asked or scan.hold(A)
    scan.until(lambda: asked.is_answered, 0.6)
    assert asked.answers == [None]
    at = scan.positions()[A]
    scan.run(3.0)
    assert scan.positions()[A] <= at + 2


# -- how it may fail ---------------------------------------------------------------------------------------


@pytest.mark.parametrize("sent", [False, True])
def test_a_hold_that_was_not_acknowledged_before_the_link_was_lost_is_made_good(
    scan: Scan, sent: bool
) -> None:
    scan.move(255, A, speed=0)
    scan.run(0.5)
    asked = scan.hold(A)
    if sent:
        scan.step(answer=False)
    else:
        scan.controller.lost(None)
    assert isinstance(asked.error, ConnectionLostError)
    scan.come_back(0.5)
    scan.run(0.5)
    at = scan.positions()[A]
    scan.run(2.0)
    assert scan.positions()[A] <= at + 1


def test_a_reset_takes_over(scan: Scan) -> None:
    scan.move(255, A)
    scan.run(0.5)
    asked = scan.hold(A)
    scan.controller.reset()
    assert not asked.is_answered, "what it does then may take long: the write comes first"
    scan.hurry()
    assert scan.last_image.activate is False
    assert isinstance(asked.error, MoveSupersededError)


def test_a_gripper_that_lost_its_activation_is_not_written_to(scan: Scan) -> None:
    scan.move(255, A)
    scan.run(0.5)
    written = len(scan.written)
    asked = scan.hold(A)
    scan.gripper.power_cycle()
    scan.run(0.5)
    assert isinstance(asked.error, NotActivatedError)
    assert len(scan.written) == written


@pytest.mark.parametrize("device_cycle", [0.005, 0.2])
def test_a_hold_is_not_late_after_a_write_that_no_echo_shows(device_cycle: float) -> None:
    """A force has no echo. That it counts as shown half a second later is no delay of the gripper."""
    scan = started(device_cycle)
    scan.move(250, A, speed=0)
    scan.run(1.0)
    scan.command(A, force=9)
    scan.run(0.8)
    at = scan.positions()[A]
    scan.hold(A)
    scan.run(1.0)
    assert scan.positions()[A] - at <= 2 + 60 * device_cycle


@pytest.mark.parametrize("device_cycle", [0.005, 0.03, 0.1, 0.2])
@pytest.mark.parametrize("speed", [0, 128, 255])
@pytest.mark.parametrize("goal", [255, 0])
@pytest.mark.parametrize("keeps", [False, True])
def test_a_hold_drives_an_axis_hardly_back(device_cycle: float, speed: int, goal: int, keeps: bool) -> None:
    """It was asked for where it was seen, and came back 20 counts when that acted a device cycle later."""
    scan = started(device_cycle)
    scan.moved(255 - goal, A, speed=255)
    scan.move(goal, A, speed=speed)
    scan.until(lambda: abs(scan.positions()[A] - (255 - goal)) > 60)
    travel, at = scan.gripper.travel(A), scan.positions()[A]
    asked = scan.hold(A) if not keeps else None
    if keeps:
        scan.stop(keep_grip=True)
    scan.run(1.0)
    assert asked is None or asked.is_answered
    way = scan.gripper.travel(A) - travel
    back = way - abs(scan.positions()[A] - at)
    assert back <= 2 * 3
    assert way <= 1 + 130 * (device_cycle + 0.02)


@pytest.mark.parametrize("back_and_forth", [False, True])
@pytest.mark.parametrize("model", [TWO_FINGER_85, HAND_E])
def test_a_hold_drives_a_jaw_that_has_just_begun_to_move_hardly_back(
    model: Model, back_and_forth: bool
) -> None:
    """It shows a motion 80 ms before it begins one: its speed came out low, and it drove 70 counts back."""
    scan = Scan(device_cycle=0.2, model=model)
    scan.start()
    scan.moved(10, A, speed=255)
    scan.move(250, A, speed=255)
    scan.until(lambda: scan.positions()[A] > 60)
    if back_and_forth:
        scan.move(0, A, speed=255)
        highest = [0]

        def has_turned() -> bool:
            highest[0] = max(highest[0], scan.positions()[A])
            return scan.positions()[A] < highest[0] - 30

        scan.until(has_turned)
    at, travel = scan.positions()[A], scan.gripper.travel(A)
    scan.hold(A)
    scan.run(1.5)
    back = scan.gripper.travel(A) - travel - abs(scan.positions()[A] - at)
    assert back <= 2 * 15


def test_a_reply_that_was_read_late_tells_no_speed(scan: Scan) -> None:
    """A loop that was held up reads two statuses in a row: a held axis was driven on to its request."""
    scan.move(255, A, speed=0)
    scan.run(0.5)
    waited = scan.status()  # asked for, and answered: it waits in the socket
    asked, blocked = scan.now, 1.5
    scan.now += blocked
    scan.controller.see(RobotiqStatus(waited.registers, scan.now, waited.sequence), asked)
    scan.now += 0.001
    scan.controller.see(scan.status(), scan.now)
    at = scan.latest.position(A)
    assert at - waited.position(A) > 20
    scan.hold(A)
    scan.step(poll=0.0)
    assert abs(scan.last_image.position(A) - at) <= 2


@pytest.mark.parametrize("device_cycle", [0.1, 0.2])
def test_a_hold_asks_an_axis_for_no_place_beyond_its_request(device_cycle: float) -> None:
    """At its speed it would have gone 20 counts further by the time at which the hold acts."""
    scan = started(device_cycle)
    scan.move(120, A, speed=255)
    scan.until(lambda: scan.positions()[A] > 110)
    asked = scan.hold(A)
    scan.run(1.0)
    assert asked.is_answered
    assert 110 <= scan.last_image.position(A) <= 120
    assert scan.positions()[A] <= 120
