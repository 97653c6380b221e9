"""Grips: what they survive, and when they end."""

from __future__ import annotations

from robotiq_async import Fault, Finger, ObjectStatus, State
from tests.control.other_client import reset_and_activated_by_another
from tests.control.scan import Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_a_grip_survives_a_halt_and_a_command_to_another_axis(scan: Scan) -> None:
    scan.gripper.place_object(B, 60)
    scan.moved(255, B)
    scan.halt()
    scan.run(0.1)
    scan.moved(100, A)
    assert scan.last_image.position(B) == 255
    assert scan.latest.finger_status(B) is ObjectStatus.CONTACT_CLOSING


def test_a_grip_is_kept_over_a_minor_fault(scan: Scan) -> None:
    scan.gripper.place_object(A, 60)
    scan.moved(255, A)
    writes = len(scan.written)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    scan.run(1.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.latest.requested_position(A) == 255
    assert len(scan.written) == writes


def test_a_halted_grip_survives_a_blink_of_the_link(scan: Scan) -> None:
    scan.gripper.place_object(B, 150)
    scan.moved(255, B)
    scan.halted()
    scan.blink()
    scan.run(0.1)
    scan.moved(60, A)
    assert scan.latest.requested_position(B) == 255


def test_a_grip_of_another_program_is_not_taken_up_again_and_held_in_place() -> None:
    """The first program let go of rGTO; the next one cannot know the requests of its fingers."""
    first = started()
    first.gripper.place_object(A | B | C, 150)
    first.moved(255)
    first.stop()
    scan = Scan(after=first)
    scan.connect()
    scan.moved(60, A | S)
    assert scan.latest.requested_position(B) == scan.latest.position(B) == 150
    assert not scan.gripper.grips
    scan.moved(80, A)
    assert scan.latest.requested_position(B) == 150


def test_a_grip_is_taken_up_again_after_a_halt(scan: Scan) -> None:
    scan.gripper.place_object(B, 60)
    scan.moved(255, B)
    scan.halted()
    assert not scan.gripper.grips
    scan.moved(100, A)
    assert scan.gripper.grips == B


def test_an_axis_that_has_moved_since_no_longer_grips(scan: Scan) -> None:
    scan.gripper.place_object(Finger.ABC, 150)
    scan.moved(255)
    scan.halted()
    scan.gripper.remove_object(Finger.ABC)
    scan.gripper.write(0, [0x0000])  # all of this while the loop is held up
    scan.now += 0.05
    scan.gripper.write(0, [0x0100])
    scan.now += 6
    scan.step()
    scan.moved(100, S)
    scan.run(3)
    assert scan.positions()[A] < 20


def test_a_motion_that_was_halted_does_not_come_back_because_the_axis_had_gripped() -> None:
    scan = started(device_cycle=0.02)
    scan.gripper.place_object(A, 150)
    scan.moved(255, A)
    scan.command(A, position=20)
    scan.step()
    scan.gripper.device_cycle = 0  # both writes fall into one tick of the device
    scan.halted()
    scan.moved(60, B)
    scan.run(3)
    assert scan.positions()[A] == 150


def test_a_grip_that_was_asked_for_again_and_halted_is_not_taken_up() -> None:
    """The part may be gone by then, and the finger would close."""
    scan = started(device_cycle=0.02)
    scan.gripper.place_object(A, 150)
    scan.moved(255, A)
    scan.halted()
    scan.command(A, position=255)
    scan.step()
    scan.gripper.device_cycle = 0  # both writes fall into one tick of the device
    scan.halted()
    scan.gripper.remove_object(A)
    scan.moved(60, B)
    scan.run(3)
    assert scan.positions()[A] == 150


def test_a_grip_by_the_request_of_another_client_is_not_taken_up(scan: Scan) -> None:
    """It came in a fault, in which no contact is noted, and was halted before the fault had cleared."""
    scan.gripper.place_object(A, 150)
    scan.moved(255, A)
    scan.gripper.inject_fault(Fault(0x0C), 1.0)
    scan.run(0.1)
    scan.gripper.write(0, scan.last_image.with_positions({A: 240}).registers)
    scan.run(0.1)
    assert scan.controller.foreign_commands == 1
    scan.halted()
    scan.gripper.remove_object(A)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    scan.moved(60, B)
    scan.run(3)
    assert scan.positions()[A] == 150


def test_after_another_clients_reset_and_activation_no_old_grip_closes_the_fingers() -> None:
    for link_is_down_meanwhile in (False, True):
        scan = started()
        scan.gripper.place_object(Finger.ABC, 150)
        scan.moved(255)
        scan.halted()
        scan.gripper.remove_object(Finger.ABC)
        if link_is_down_meanwhile:
            scan.controller.lost(None)
            scan.gripper.write(0, [0x0000])
            scan.now += 0.05
            scan.gripper.write(0, [0x0100])
            scan.come_back(10)
        else:
            reset_and_activated_by_another(scan)
        scan.moved(100, S)
        scan.run(3)
        assert scan.positions()[A] < 20


def test_a_contact_that_may_be_from_before_is_no_grip() -> None:
    """Sent away and back within the lag, and halted: the part is gone, and nothing may close on its place."""
    scan = started(lag=8)
    scan.gripper.place_object(A, 150)
    assert scan.moved(255, A, speed=255).contacts == A
    scan.run(1.0)
    scan.move(0, A, speed=0)
    scan.run(0.005)
    scan.gripper.remove_object(A)
    scan.move(255, A, speed=0)
    scan.run(0.01)
    scan.halt()
    scan.run(0.1)
    travel = scan.gripper.travel(A)
    scan.command(S, position=100)
    scan.run(3.0)
    assert scan.gripper.travel(A) - travel <= 2
