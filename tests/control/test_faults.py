"""Faults: what they end, and that nothing resumes when they clear."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import Fault, Finger, GripperFaultError, NotActivatedError, State
from robotiq_async.control.evidence import LASTS_READS
from robotiq_async.values.enums import Trigger
from robotiq_async.values.request import Request
from tests.control.other_client import image, moved_by_another
from tests.control.scan import POLL_S, Scan, started

UNKNOWN = Fault(0x0C)
A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


@pytest.mark.parametrize("code", [0x09, 0x0A, 0x0C, 0x0D, 0x0E, 0x01])
def test_a_serious_or_unknown_fault_ends_a_move_at_once(scan: Scan, code: int) -> None:
    _, outcome = scan.move(255)
    scan.run(0.3)
    scan.gripper.inject_fault(code)
    scan.run((LASTS_READS + 1) * POLL_S if code == 0x09 else POLL_S)
    assert scan.state is State.FAULT
    assert isinstance(outcome.error, GripperFaultError)
    assert outcome.error.fault == code
    with pytest.raises(GripperFaultError):
        scan.command(A, position=0)


@pytest.mark.parametrize("code", [0x05, 0x06, 0x07])
def test_priority_codes_neither_raise_nor_lead_to_fault(scan: Scan, code: int) -> None:
    _, outcome = scan.move(255)
    scan.run(0.3)
    scan.gripper.inject_fault(code)
    scan.until(lambda: outcome.is_answered)
    assert scan.state is State.RUNNING_IDLE
    assert outcome.result.positions[A] >= 240


def test_a_gripper_found_in_fault_is_left_there() -> None:
    scan = Scan()
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.connect()
    scan.run(0.5)
    assert scan.state is State.FAULT
    assert not scan.written
    assert scan.controller.foreign_commands == 0


def test_nothing_resumes_when_a_minor_fault_clears(scan: Scan) -> None:
    scan.move(255)
    scan.run(0.5)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    scan.run(0.5)
    at = scan.gripper.position(A)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    scan.run(2.0)
    assert not scan.gripper.is_moving
    assert scan.gripper.position(A) == pytest.approx(at, abs=2)


def test_a_motion_that_is_not_awaited_does_not_resume_either(scan: Scan) -> None:
    scan.command(A, position=255)
    scan.run(0.5)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    scan.run(3.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.gripper.position(A) < 200


def test_a_command_sent_just_before_the_fault_does_not_begin_to_act_when_it_clears() -> None:
    scan = started(0.2)
    scan.command(A, position=149)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    scan.run(3.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.gripper.position(A) <= 7


def test_a_write_lost_before_the_fault_does_not_begin_to_act_when_it_clears() -> None:
    scan = started(0.2)
    scan.command(A, position=149)
    scan.step(answer=False)
    scan.connect(activate=False)
    scan.step()
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    scan.run(3.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.gripper.position(A) <= 7


def test_nothing_resumes_when_a_fault_clears_that_began_while_the_link_was_down(scan: Scan) -> None:
    scan.move(200, A, speed=0)
    scan.run(0.5)
    scan.controller.lost(None)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2)
    scan.come_back(0.1)
    assert scan.state is State.FAULT
    with pytest.raises(GripperFaultError):
        scan.command(B, position=3)
    at = scan.positions()[A]
    scan.run(10)
    assert scan.positions()[A] <= at + 4


def test_a_halt_of_another_client_in_the_status_of_a_fault_stays_a_halt() -> None:
    """The hold for the fault was made of our image, with rGTO set: B moved on when the fault cleared."""
    scan = started()
    scan.gripper.write(0, image({A: 6, B: 200, C: 6}, speed=0))
    scan.run(0.5)
    scan.command(A, position=250, speed=0)
    scan.run(0.3)
    halted = replace(scan.last_image, go=False)
    scan.gripper.write(0, halted.registers)
    scan.now += 0.006
    scan.gripper.inject_fault(Fault.SCISSOR_INTERFERENCE, 1.0)
    scan.step()
    assert scan.state is State.FAULT
    at = scan.gripper.position(B)
    scan.run(3.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.controller.foreign_commands == 2
    assert not scan.latest.go_echo
    assert scan.gripper.position(B) == at


def test_an_axis_that_the_fault_keeps_from_starting_is_held() -> None:
    scan = started(0.0)
    scan.moved(6)
    scan.command(A, position=107)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    scan.run(3.0)
    assert scan.gripper.position(A) <= 7


@pytest.mark.parametrize(
    ("device_cycle", "by"),
    [
        *((0.0, -2), (0.0, 1), (0.005, -1), (0.005, 2)),
        *((0.03, -2), (0.03, 1), (0.2, -1), (0.2, 2)),
    ],
)
def test_an_axis_that_the_fault_keeps_from_its_last_two_counts_is_held(device_cycle: float, by: int) -> None:
    """So close to its request an axis counts as there; one that had not begun yet moved afterwards."""
    for steps in range(by % 2, 8, 2):
        scan = started(device_cycle)
        scan.moved(40, A)
        scan.move(40 + by, A)
        for _ in range(steps):
            scan.step()
        scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
        scan.run(0.3)
        assert scan.state is State.FAULT
        at = scan.gripper.travel(A)
        scan.run(0.8)
        assert scan.state is State.RUNNING_IDLE
        assert scan.gripper.travel(A) == at, f"it went on, {steps} steps after the command"


def test_a_motion_of_ours_does_not_resume_after_a_fault_because_another_client_moved_another_axis(
    scan: Scan,
) -> None:
    _, outcome = scan.move(200, A)
    scan.run(0.3)
    image = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, image.with_positions({B: 60}).registers)
    scan.run(0.5)
    assert not outcome.is_answered, "A is still ours"
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    scan.run(0.1)
    assert isinstance(outcome.error, GripperFaultError)
    at = scan.positions()[A]
    scan.run(5)
    assert scan.positions()[A] <= at + 2
    assert scan.positions()[B] == 60, "what the other client asked goes on"


def test_a_fault_does_not_stop_the_motion_of_another_client_after_a_blink_of_the_link() -> None:
    scan = moved_by_another()
    scan.blink()
    scan.run(0.3)
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.1)
    scan.run(15)
    assert not scan.written
    assert scan.positions()[A] == 200


def test_a_fault_at_the_loss_of_the_activation_does_not_activate(scan: Scan) -> None:
    scan.move(200, A)
    scan.run(0.3)
    written = len(scan.written)
    scan.gripper.power_cycle()
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    at = scan.positions()
    scan.run(3)
    assert scan.positions() == at
    assert scan.state is State.RESET
    assert len(scan.written) == written


def test_nothing_is_written_to_a_gripper_whose_reset_by_another_client_shows_with_a_fault(scan: Scan) -> None:
    """A hold would carry rACT = 0, and might end the activation that the other client begins next."""
    scan.move(200, A)
    scan.run(0.3)
    written = len(scan.written)
    first, *others = scan.gripper.request_registers
    scan.gripper.write(0, (first & ~0x0100, *others))
    scan.now += 0.01
    assert not scan.status().activation_echo
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.run(0.5)
    assert scan.latest.go_echo
    assert not scan.latest.activation_echo
    assert scan.state is State.FAULT
    assert len(scan.written) == written


def test_stops_pending_in_fault_are_not_written_once_the_activation_is_lost(scan: Scan) -> None:
    """A hold or a halt carries rACT = 1: written after a power cycle it would activate."""
    scan.move(255)
    scan.run(0.5)
    scan.gripper.inject_fault(UNKNOWN)
    scan.step()
    assert scan.state is State.FAULT
    halted = scan.halt()
    writes = len(scan.written)
    scan.gripper.power_cycle()
    scan.see()
    assert isinstance(halted.error, NotActivatedError)
    scan.run(0.5)
    assert scan.state is State.RESET
    assert len(scan.written) == writes
    assert not scan.gripper.is_moving


@pytest.mark.parametrize("stop", ["hold", "halt"])
def test_a_fault_that_clears_before_a_stop_is_sent_leads_to_where_the_table_says(stop: str) -> None:
    scan = started()
    scan.command(A, position=255, speed=0)
    scan.run(0.2)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.until(lambda: scan.state is State.FAULT)
    scan.gripper.clear_faults()
    outcome = scan.hold(A) if stop == "hold" else scan.halt()
    scan.step()
    assert scan.transitions[-1] == (State.FAULT, State.RUNNING_IDLE, Trigger.SEEN_READY)
    scan.run(0.1)
    assert outcome.answers == [None]
    assert scan.state is State.RUNNING_IDLE


@pytest.mark.parametrize("device_cycle", [0.005, 0.2])
def test_an_axis_that_a_fault_has_stopped_is_held_where_it_stands(device_cycle: float) -> None:
    """And not where it would be without the fault: it would go there when that clears."""
    scan = started(device_cycle)
    scan.move(255, A, speed=255)
    scan.run(1.0)
    scan.gripper.inject_fault(0x09, 1.0)
    scan.run(0.1)
    travel = scan.gripper.travel(A)
    scan.run(3.0)
    assert scan.state is State.RUNNING_IDLE
    assert scan.gripper.travel(A) - travel <= 2
