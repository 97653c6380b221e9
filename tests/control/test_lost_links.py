"""A link that goes down and comes back: nothing is replayed, nothing is undone, and a stop is not lost."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import ConnectionLostError, Finger, RobotiqStatus, State
from robotiq_async.control.pending import changes
from robotiq_async.values.request import AxisRequest, Request
from tests.control.other_client import activated_by_another, going_to, image
from tests.control.scan import POLL_S, Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_a_lost_link_drops_what_was_not_acknowledged(scan: Scan) -> None:
    pending = scan.command(A, position=200)
    _, move = scan.move(100, B)
    scan.controller.lost(None)
    assert isinstance(pending.error, ConnectionLostError)
    assert isinstance(move.error, ConnectionLostError)
    assert scan.state is State.DISCONNECTED
    with pytest.raises(ConnectionLostError):
        scan.command(A, position=1)
    writes = len(scan.written)
    scan.connect(activate=False)
    scan.run(2.0)
    assert len(scan.written) == writes
    assert scan.state is State.RUNNING_IDLE


def test_a_write_that_arrived_unacknowledged_is_ours_when_it_shows(scan: Scan) -> None:
    lost = scan.command(A, position=200)
    scan.step(answer=False)
    assert isinstance(lost.error, ConnectionLostError)
    scan.now += 0.001  # back before the gripper acts on it
    scan.connect(activate=False)
    scan.run(0.1)
    assert scan.controller.foreign_commands == 0
    assert scan.latest.requested_position(A) == 200
    writes = len(scan.written)
    scan.moved(50, B)
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.gripper.position(A) == pytest.approx(200, abs=2), "B's command keeps what A was asked"
    assert len(scan.written) == writes + 1


@pytest.mark.parametrize("theirs", [{S: 100}, {A: 200}], ids=["another axis", "the axis"])
def test_a_hold_survives_a_lost_link_on_the_axes_that_no_other_client_has_moved(
    scan: Scan, theirs: dict[Finger, int]
) -> None:
    scan.move(250, A, speed=0)
    scan.run(0.3)
    scan.hold(A)
    scan.controller.lost(None, scan.now)
    read = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, read.with_positions(theirs).registers)
    scan.now += 0.1
    at = scan.gripper.position(A)
    scan.connect(activate=False)
    scan.run(10.0)
    assert scan.gripper.position(A) == pytest.approx(at if A not in theirs else 200, abs=5)
    assert scan.gripper.position(S) == pytest.approx(theirs.get(S, 137), abs=2)


def test_a_hold_that_was_acknowledged_and_forgotten_is_written_again_after_a_lost_link(scan: Scan) -> None:
    """A UR acknowledges a SET, loses it, and its link goes: the axis went on to its request."""
    scan.move(250, A, speed=0)
    scan.run(0.3)
    scan.forgets = 1
    held = scan.hold(A)
    scan.step()
    assert held.is_answered
    scan.blink()
    at = scan.gripper.position(A)
    scan.run(10.0)
    assert scan.gripper.position(A) == pytest.approx(at, abs=10)


def test_a_hold_that_has_shown_ends_no_later_motion_over_a_lost_link(scan: Scan) -> None:
    scan.move(200, A, speed=0)
    scan.run(0.3)
    scan.hold(A)
    scan.run(0.3)
    scan.move(200, A, speed=0)
    scan.run(0.3)
    scan.blink()
    scan.run(20.0)
    assert scan.gripper.position(A) == pytest.approx(200, abs=2)


def test_a_move_that_is_given_up_only_once_the_link_is_back_is_held_even_after_a_change_of_mode(
    scan: Scan,
) -> None:
    """Its caller has the error of the link, and has not left as the gripper shows that it is busy."""
    move, outcome = scan.move(250, A, speed=0)
    scan.run(0.3)
    scan.controller.lost(None, scan.now)
    assert isinstance(outcome.error, ConnectionLostError)
    status = scan.status()
    gimc_2 = (status.registers[0] & ~0x3000) | 0x2000
    changing = RobotiqStatus((gimc_2, *status.registers[1:]), scan.now, scan.polls, status.model)
    scan.controller.see(changing, scan.now)
    assert scan.state is State.WF_ACTIVATION
    scan.controller.abandon(move, unseen=True)
    at = scan.gripper.position(A)
    scan.run(10.0)
    assert scan.gripper.position(A) == pytest.approx(at, abs=5)


@pytest.mark.parametrize("device_cycle", [0.1, 0.2])
def test_a_write_that_comes_late_before_the_link_goes_is_not_undone(device_cycle: float) -> None:
    """Its doubt was over when the link was found lost, and the command for B sent A back to where it was."""
    scan = started(device_cycle)
    scan.run(1)
    scan.command(A, position=200, speed=255)
    scan.step(answer=False, arrives=0.3, lost=0.4)
    scan.come_back(0.02)
    scan.command(B, position=50)
    scan.run(4)
    assert scan.gripper.position(A) == pytest.approx(200, abs=2)
    assert scan.controller.foreign_commands == 0


def test_a_second_lost_link_brings_back_nothing_that_was_replaced(scan: Scan) -> None:
    """A write echoed after the first loss was taken for lost at the second: B went back to 200."""
    scan.move(200, B)
    scan.run(0.5)
    scan.command(B, position=10)
    scan.step(answer=False)
    scan.come_back(0.01)
    scan.run(0.1)
    assert scan.latest.requested_position(B) == 10
    scan.controller.lost(None)
    scan.come_back(0.01)
    scan.moved(100, A)
    assert scan.last_image.position(B) == 10
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.gripper.position(B) == pytest.approx(10, abs=2)


def test_a_motion_goes_on_over_a_lost_link_and_is_adopted(scan: Scan) -> None:
    scan.move(255, A)
    scan.run(0.5)
    scan.controller.lost(None)
    scan.come_back(0.3)
    assert scan.state is State.RUNNING_IDLE
    scan.moved(100, B)
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.gripper.position(A) >= 240
    assert scan.controller.foreign_commands == 0


def test_a_gripper_that_lost_its_power_is_not_activated_by_a_reconnect(scan: Scan) -> None:
    scan.move(255)
    scan.run(0.5)
    scan.controller.lost(None)
    scan.gripper.power_cycle()
    scan.come_back(0.1)
    scan.run(1.0)
    assert scan.state is State.RESET
    assert not scan.gripper.is_moving


@pytest.mark.parametrize("device_cycle", [0.005, 0.03, 0.1, 0.2])
@pytest.mark.parametrize("arrived", [True, False])
def test_a_command_after_a_lost_acknowledgement_waits_until_it_is_known_what_acts(
    device_cycle: float, arrived: bool
) -> None:
    scan = started(device_cycle)
    scan.command(S, position=32)
    scan.run(0.6)
    scan.command(S, position=200)
    if arrived:
        scan.step(answer=False)
    else:
        scan.now += POLL_S
        assert scan.controller.decide(scan.now) is not None
        scan.controller.lost(None)
    scan.now += 0.001
    scan.connect(activate=False)  # before the gripper acts on it, if it got it
    pending = scan.command(A, position=50)
    began = scan.now
    scan.until(lambda: pending.is_answered)
    assert scan.now - began < 0.5
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.positions()[S] == pytest.approx(200 if arrived else 32, abs=2)
    assert scan.positions()[A] == pytest.approx(50, abs=2)
    positions = [Request.from_registers(image).position(S) for image in scan.written]
    assert positions[-1] == (200 if arrived else 32)


def test_a_lost_command_does_not_come_back_when_the_gripper_was_busy_at_the_reconnect(scan: Scan) -> None:
    scan.moved(50)
    scan.controller.command(changes(A, 250))
    scan.now += POLL_S
    assert scan.controller.decide(scan.now) is not None  # it never arrives
    scan.controller.lost(None)
    image = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, replace(image, individual_scissor=False).registers)  # a mode change: gIMC = 2
    scan.come_back(0.2)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    scan.run(1)
    scan.moved(60, B)
    scan.run(2)
    assert scan.positions()[A] <= 52


def test_an_adopted_request_is_not_ours_after_a_short_link_loss() -> None:
    scan = activated_by_another()
    scan.gripper.place_object(Finger.ABC, 150)
    simple = (AxisRequest(200, 128, 64), AxisRequest(), AxisRequest(), AxisRequest(137))
    scan.gripper.write(0, Request(activate=True, go=True, individual_fingers=False, axes=simple).registers)
    scan.now += 0.5
    scan.connect(activate=False)  # while the fingers close, all of them by A's registers
    scan.run(8)
    scan.blink()
    scan.run(1)
    scan.moved(100, S)
    scan.run(3)
    assert scan.positions()[B] == 150, "B still holds"


# -- holds: unlike motions they are not dropped ----------------------------------------------------------


def test_a_hold_survives_a_lost_link() -> None:
    # A hold is a stop: unlike a motion it is not dropped.
    for written in (False, True):
        scan = started()
        move, _ = scan.move(200, A, speed=0)
        scan.run(0.5)
        scan.controller.abandon(move)
        if written:
            scan.now += POLL_S
            assert scan.controller.decide(scan.now) is not None  # and it is lost
        scan.controller.lost(None)
        at = scan.positions()[A]
        scan.come_back(0.05)
        assert scan.state is State.RUNNING_IDLE, "nothing was asked for"
        scan.run(5)
        # Whether a lost hold arrived is known after a device cycle: a quarter of a second, six counts.
        assert scan.positions()[A] <= at + (8 if written else 4)
        assert scan.state is State.RUNNING_IDLE


@pytest.mark.parametrize("how", ["halt", "command"])
def test_a_hold_outlives_what_has_replaced_it_and_was_lost(scan: Scan, how: str) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.abandon(move)
    if how == "halt":
        scan.halt()
    else:
        scan.command(A, position=10)
    at = scan.positions()[A]
    scan.blink()
    scan.run(10)
    assert abs(scan.positions()[A] - at) <= 4


def lose_the_link(scan: Scan, *, is_written: bool) -> None:
    """The link goes down before what is pending is written, or with its write, which the gripper forgets."""
    if not is_written:
        scan.blink()
        return
    scan.forgets = 1
    scan.step(answer=False)
    scan.come_back(0.05)


@pytest.mark.parametrize("is_written", [False, True])
def test_a_cancelled_move_is_held_although_what_took_over_its_axis_is_lost(
    scan: Scan, is_written: bool
) -> None:
    move, _ = scan.move(200, A | B, speed=0)
    scan.run(0.5)
    scan.command(A, position=10)
    scan.controller.abandon(move, unseen=True)
    at = scan.positions()
    lose_the_link(scan, is_written=is_written)
    scan.run(10)
    assert [abs(scan.positions()[axis] - at[axis]) <= 10 for axis in (A, B)] == [True, True]


@pytest.mark.parametrize("is_written", [False, True])
@pytest.mark.parametrize("stop", ["halt", "reset"])
def test_what_a_lost_stop_was_to_end_is_held_once_the_link_is_back(
    scan: Scan, stop: str, is_written: bool
) -> None:
    """The fingers went on to the end, also if the caller was cancelled and never saw the error."""
    scan.gripper.place_object(B, 60)
    scan.moved(255, B)
    scan.command(A, 200, speed=0)
    scan.run(0.5)
    at = scan.positions()[A]
    if stop == "halt":
        scan.halt()
    else:
        scan.controller.reset()
    lose_the_link(scan, is_written=is_written)
    scan.run(10)
    assert scan.positions()[A] < at + 10
    assert scan.latest.go_echo
    assert scan.gripper.grips == B


def test_a_lost_halt_does_not_stop_another_client_later(scan: Scan) -> None:
    scan.command(A, 200, speed=0)
    scan.run(0.5)
    scan.halt()
    scan.controller.lost(None)
    scan.gripper.write(0, going_to(255, speed=0))
    scan.come_back(1.0)
    written = len(scan.written)
    scan.run(15)
    assert len(scan.written) == written
    assert scan.positions()[A] >= 240


def test_a_lost_hold_is_dropped_when_the_gripper_comes_back_reset(scan: Scan) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.abandon(move)
    scan.controller.lost(None)
    assert scan.controller.has_open_stop
    scan.gripper.write(0, [0x0000])
    scan.now += 0.5
    scan.see()
    assert scan.state is State.RESET
    assert not scan.controller.has_open_stop


def test_a_reset_that_was_lost_and_has_come_to_act_leaves_nothing_to_hold(scan: Scan) -> None:
    """The image that shows is our own, and what we moved is held in place of a reset that did not arrive."""
    scan.command(A, 200, speed=0)
    scan.run(0.5)
    scan.controller.reset()
    scan.step(answer=False)
    assert scan.controller.has_open_stop
    scan.come_back(1.0)
    assert scan.state is State.RESET
    assert not scan.controller.has_open_stop


def test_a_hold_is_dropped_when_another_client_commands_after_the_link_loss(scan: Scan) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.abandon(move)
    scan.controller.lost(None)
    image = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, image.with_positions({A: 90}).registers)
    scan.now += 0.5
    written = len(scan.written)
    scan.connect(activate=False)
    scan.run(5)
    assert len(scan.written) == written


def test_a_lost_hold_does_not_outlive_an_activation(scan: Scan) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.3)
    scan.controller.abandon(move)
    scan.controller.lost(None)
    scan.gripper.power_cycle()
    scan.now += 0.1
    scan.connect(activate=True)  # as a policy may have it
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    scan.command(A, position=200)
    scan.run(0.5)
    scan.blink()
    scan.run(10)
    assert scan.positions()[A] >= 198


# -- what has no echo ------------------------------------------------------------------------------------


@pytest.mark.parametrize("moved_before", [False, True])
def test_an_acknowledged_speed_survives_a_blink_of_the_link(moved_before: bool) -> None:
    scan = started(device_cycle=0.1)
    if moved_before:
        scan.command(B, position=120)
        scan.step()
    scan.command(B, speed=77, force=33)
    scan.step()
    scan.blink()
    scan.run(0.3)
    scan.command(A, position=60)
    scan.run(0.6)
    image = Request.from_registers(scan.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (77, 33)


def test_a_speed_that_was_not_acknowledged_is_not_taken_for_the_axis_s_own(scan: Scan) -> None:
    scan.command(B, speed=77, force=33)
    scan.step(answer=False)
    scan.come_back(0.05)
    scan.run(0.3)
    scan.command(A, position=60)
    scan.run(0.6)
    image = Request.from_registers(scan.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (128, 64)


@pytest.mark.parametrize("link_is_back", [False, True])
def test_a_move_cancelled_as_its_link_was_lost_is_held_though_it_had_ended(link_is_back: bool) -> None:
    """Its caller never saw the error, and knows nothing of a motion that continues."""
    scan = started()
    move, outcome = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.lost(None)
    assert isinstance(outcome.error, ConnectionLostError)
    if link_is_back:
        scan.come_back(0.05)
    scan.controller.abandon(move, unseen=True)
    at = scan.positions()[A]
    if not link_is_back:
        scan.come_back(0.05)
    scan.run(10)
    assert abs(scan.positions()[A] - at) <= 4


def test_a_move_cancelled_as_its_link_was_lost_is_not_held_where_another_client_moves_its_axis() -> None:
    scan = started()
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.lost(None)
    scan.gripper.write(0, image({A: 255}, speed=0))
    scan.come_back(0.05)
    scan.controller.abandon(move, unseen=True)
    scan.run(15)
    assert scan.positions()[A] >= 240


def test_a_move_that_was_given_up_after_its_error_was_seen_goes_on(scan: Scan) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.lost(None)
    scan.controller.abandon(move)
    scan.come_back(0.05)
    scan.run(10)
    assert scan.positions()[A] >= 198


def test_an_adopted_axis_gets_the_time_to_show_its_direction_once_more() -> None:
    """Under simple control B follows A, and its own echo points the other way."""
    scan = activated_by_another()
    scan.gripper.write(0, image({A: 255, B: 0, C: 0, S: 137}, individual=False, speed=0))
    scan.now += 1.0
    scan.connect(activate=False)
    scan.run(0.5)
    scan.blink()
    scan.command(S, position=100)
    scan.run(1.0)
    assert scan.last_image.position(B) == 255
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.positions()[B] >= 240


def test_a_link_that_goes_down_before_a_write_shows_hides_no_delay_of_the_gripper() -> None:
    """Its write counted as sent when the link went down: a held axis came back 15 counts."""
    scan = started(0.2)
    scan.moved(0, A, speed=255)
    scan.move(255, A, speed=255)
    scan.run(0.15)
    scan.controller.lost(None, scan.now)
    scan.until(lambda: scan.positions()[A] > 60)
    travel, at = scan.gripper.travel(A), scan.positions()[A]
    scan.hold(A)
    scan.run(1.0)
    back = scan.gripper.travel(A) - travel - abs(scan.positions()[A] - at)
    assert back <= 2 * 3
