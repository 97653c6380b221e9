"""Images that may still act: no status shows them, and what is decided takes them into account."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robotiq_async import Fault, Finger, State
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import Trigger
from robotiq_async.values.status import RobotiqStatus
from tests.control.scan import Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR
SLOW = pytest.mark.parametrize("device_cycle", [0.03, 0.05, 0.1, 0.2])


def lost_in_doubt(scan: Scan) -> None:
    """The write that is due arrives, its acknowledgement does not, and the link is back at once."""
    scan.step(answer=False)
    scan.come_back(0.001)


# -- our own reset -----------------------------------------------------------------------------------------


def stopped(scan: Scan) -> None:
    scan.stop()


def halted(scan: Scan) -> None:
    scan.halted()


def kept(scan: Scan) -> None:
    scan.stop(keep_grip=True)


@SLOW
@pytest.mark.parametrize("how", [stopped, halted, kept])
def test_no_stop_activates_while_a_reset_of_ours_may_still_act(
    how: Callable[[Scan], None], device_cycle: float
) -> None:
    """Its rACT came after the reset, and rose: the fingers moved until that was taken back."""
    scan = started(device_cycle)
    scan.moved(100)
    scan.run(1.0)
    before = scan.travels()
    scan.controller.reset()
    lost_in_doubt(scan)
    how(scan)
    scan.run(1.0)
    scan.now += 20
    assert scan.travels() == before
    assert not scan.status().activation_echo


@SLOW
def test_a_stop_long_after_a_lost_reset_that_never_arrived_leaves_the_gripper_active(
    device_cycle: float,
) -> None:
    """A needless reset would drop the part."""
    scan = started(device_cycle)
    scan.moved(100)
    scan.forgets = 1
    scan.controller.reset()
    lost_in_doubt(scan)
    scan.run(0.3)
    scan.stop()
    scan.run(1.0)
    assert scan.status().is_activated
    assert not scan.status().go_echo


# -- motion that is about to begin -------------------------------------------------------------------------


def test_a_hand_moves_from_the_call_of_an_activation_to_its_end() -> None:
    scan = Scan(device_cycle=0.1)
    scan.connect(activate=False)
    assert not scan.controller.is_moving
    scan.controller.activate()
    assert scan.controller.is_moving, "not written"
    scan.step()
    assert scan.controller.is_moving, "not acting"
    seen = []
    while scan.state is not State.RUNNING_IDLE:
        scan.step(poll=0.02)
        seen.append(scan.controller.is_moving)
    assert all(seen[:-1])
    scan.run(0.1)
    assert not scan.controller.is_moving


def test_a_hand_moves_from_the_call_of_a_release_to_its_end(scan: Scan) -> None:
    scan.moved(200)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    while scan.state is not State.ATR_DONE:
        assert scan.controller.is_moving, scan.state
        scan.step(poll=0.02)
    assert not scan.controller.is_moving
    scan.controller.reset()
    scan.run(0.2)
    assert scan.state is State.RESET
    assert not scan.controller.is_moving


def test_a_hand_moves_while_an_emergency_release_of_another_client_opens_the_fingers(scan: Scan) -> None:
    scan.moved(200)
    scan.gripper.emergency_release()
    scan.until(lambda: scan.latest.fault is Fault.AUTOMATIC_RELEASE)
    assert scan.controller.is_driven
    assert scan.controller.is_moving


def test_a_release_drives_the_fingers_whatever_gimc_shows(scan: Scan) -> None:
    """That gIMC is 0 during a release is in the manual alone."""
    scan.moved(200)
    registers = list(scan.latest.registers)
    reg.gFLT.write(registers, Fault.AUTOMATIC_RELEASE)
    released = RobotiqStatus(tuple(registers), scan.now, scan.polls + 1)
    assert released.is_activated
    scan.controller.see(released, scan.now)
    assert scan.controller.is_driven
    assert scan.controller.is_moving


def test_a_hand_moves_while_another_client_activates_the_gripper(scan: Scan) -> None:
    scan.gripper.write(0, [0x0000])
    scan.run(0.05)
    assert not scan.controller.is_driven
    scan.gripper.write(0, [0x0100])
    scan.run(0.05)
    assert scan.controller.is_driven
    assert scan.controller.is_moving


@SLOW
def test_a_hand_may_move_if_an_activation_was_lost_with_the_link(device_cycle: float) -> None:
    scan = Scan(device_cycle=device_cycle)
    scan.connect(activate=False)
    scan.controller.activate()
    lost_in_doubt(scan)
    assert scan.state is State.RESET
    assert scan.controller.is_moving
    assert scan.controller.is_driven


@SLOW
def test_a_hand_moves_in_a_reset_before_which_a_motion_in_doubt_may_act(device_cycle: float) -> None:
    scan = started(device_cycle)
    scan.command(A, position=255)
    lost_in_doubt(scan)
    scan.controller.reset()
    while scan.state is not State.RESET:
        before, is_moving = scan.travels(), scan.controller.is_moving
        scan.step()
        assert is_moving or scan.travels() == before


# -- a halt where rGTO = 0 ends nothing --------------------------------------------------------------------


@SLOW
def test_a_halt_ends_an_activation_that_was_lost_with_the_link_and_does_not_act_yet(
    device_cycle: float,
) -> None:
    scan = Scan(device_cycle=device_cycle)
    scan.connect(activate=False)
    scan.controller.activate()
    lost_in_doubt(scan)
    scan.controller.reset(Trigger.HALT_RESETS)
    scan.run(1.0)
    assert scan.state is State.RESET
    before = scan.travels()
    scan.now += 20
    assert scan.travels() == before


def test_a_hold_tells_that_it_ends_no_release(scan: Scan, caplog: pytest.LogCaptureFixture) -> None:
    scan.moved(200)
    scan.gripper.emergency_release()
    scan.until(lambda: scan.latest.fault is Fault.AUTOMATIC_RELEASE)
    scan.hold()
    assert "a hold ends no activation and no release: halt() does" in caplog.text


# -- what the last session has left ------------------------------------------------------------------------


@SLOW
@pytest.mark.parametrize("link_is_lost", [False, True])
def test_a_command_to_another_axis_does_not_resume_what_the_last_session_left_on_its_way(
    device_cycle: float, link_is_lost: bool
) -> None:
    """stop(halt=False) while a hold was on its way; the next start took the status for what is asked."""
    first = started(device_cycle)
    first.command(A, position=255, speed=0)
    first.run(2.0)
    at = first.positions()[A]
    first.hold(A)
    first.step(answer=not link_is_lost)
    scan = Scan(after=first, goes_on=True)
    scan.now += 0.001
    scan.connect()
    scan.command(B, position=100)
    scan.run(5.0)
    assert scan.positions()[A] <= at + 10
    assert scan.positions()[B] == 100


@SLOW
def test_a_stop_ends_a_motion_that_the_last_session_left_on_its_way(device_cycle: float) -> None:
    first = started(device_cycle)
    first.command(A, position=255, speed=0)
    first.step()
    scan = Scan(after=first, goes_on=True)
    scan.now += 0.001
    scan.connect()
    assert scan.controller.is_moving
    scan.stop()
    before = scan.travels()
    scan.now += 20
    assert scan.travels() == before


def test_a_hold_keeps_the_grip_that_the_last_session_has_halted() -> None:
    first = started()
    first.gripper.place_object(A, 150)
    first.moved(255, A)
    first.stop(keep_grip=True)
    scan = Scan(after=first, goes_on=True)
    scan.connect()
    scan.move(255, A, force=255)
    scan.until(lambda: A in scan.latest.moving)
    asked = scan.hold()
    scan.run(1.0)
    assert asked.answers == [None]
    assert scan.gripper.grips == A


def test_a_stop_takes_back_an_activation_that_the_last_session_has_begun() -> None:
    first = Scan(device_cycle=0.1)
    first.connect()
    first.step()
    scan = Scan(after=first, goes_on=True)
    scan.now += 0.001
    scan.connect(activate=False)
    scan.until(lambda: scan.state is State.WF_ACTIVATION)
    scan.run(0.5)
    assert scan.state is State.WF_ACTIVATION, "it was asked for"
    scan.stop()
    before = scan.travels()
    scan.now += 20
    assert scan.travels() == before


def test_a_stop_leaves_the_activation_of_a_session_that_ended_after_it_alone() -> None:
    first = started()
    scan = Scan(after=first, goes_on=True)
    scan.connect()
    scan.stop()
    assert scan.status().is_activated
