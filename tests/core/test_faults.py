"""Faults, resets, releases and the end."""

from __future__ import annotations

import pytest

from robotiq_async import (
    Fault,
    Finger,
    GripperFaultError,
    InvalidStateError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    State,
)
from robotiq_async.wire.request import Request
from tests.bench import POLL_S, Bench

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.start()
    return bench


@pytest.mark.parametrize("code", [0x09, 0x0A, 0x0C, 0x0D, 0x0E, 0x01])
def test_a_serious_or_unknown_fault_ends_a_move_at_once(bench: Bench, code: int) -> None:
    _, outcome = bench.move(255)
    bench.run(0.3)
    bench.gripper.inject_fault(code)
    bench.step()
    assert bench.state is State.FAULT
    assert isinstance(outcome.error, GripperFaultError)
    assert outcome.error.fault == code
    with pytest.raises(GripperFaultError):
        bench.command(A, position=0)


@pytest.mark.parametrize("code", [0x05, 0x06, 0x07])
def test_priority_codes_neither_raise_nor_lead_to_fault(bench: Bench, code: int) -> None:
    _, outcome = bench.move(255)
    bench.run(0.3)
    bench.gripper.inject_fault(code)
    bench.until(lambda: outcome.is_told)
    assert bench.state is State.RUNNING_IDLE
    assert outcome.result.positions[A] >= 240


def test_nothing_resumes_when_a_minor_fault_clears(bench: Bench) -> None:
    bench.move(255)
    bench.run(0.5)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    bench.run(0.5)
    at = bench.gripper.position(A)
    bench.until(lambda: bench.state is State.RUNNING_IDLE)
    bench.run(2.0)
    assert not bench.gripper.is_moving
    assert bench.gripper.position(A) == pytest.approx(at, abs=2)


def test_a_motion_nobody_awaits_does_not_resume_either(bench: Bench) -> None:
    bench.command(A, position=255)
    bench.run(0.5)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    bench.run(3.0)
    assert bench.state is State.RUNNING_IDLE
    assert bench.gripper.position(A) < 200


def test_a_command_sent_just_before_the_fault_does_not_begin_to_act_when_it_clears() -> None:
    bench = Bench(device_cycle=0.2)
    bench.start()
    bench.command(A, position=149)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    bench.run(3.0)
    assert bench.state is State.RUNNING_IDLE
    assert bench.gripper.position(A) <= 7


def test_a_write_lost_before_the_fault_does_not_begin_to_act_when_it_clears() -> None:
    bench = Bench(device_cycle=0.2)
    bench.start()
    bench.command(A, position=149)
    bench.step(answer=False)
    bench.connect(activate=False)
    bench.step()
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    bench.run(3.0)
    assert bench.state is State.RUNNING_IDLE
    assert bench.gripper.position(A) <= 7


def test_an_axis_that_the_fault_keeps_from_starting_is_held() -> None:
    bench = Bench(device_cycle=0.0)
    bench.start()
    bench.moved(6)
    bench.command(A, position=107)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    bench.run(3.0)
    assert bench.gripper.position(A) <= 7


def test_a_grip_is_kept_over_a_minor_fault(bench: Bench) -> None:
    bench.gripper.place_object(A, 60)
    bench.moved(255, A)
    writes = len(bench.written)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    bench.run(1.0)
    assert bench.state is State.RUNNING_IDLE
    assert bench.latest.requested_position(A) == 255
    assert len(bench.written) == writes


def test_the_release_is_for_faults_only(bench: Bench) -> None:
    with pytest.raises(InvalidStateError) as caught:
        bench.controller.release()
    assert caught.value.state is State.RUNNING_IDLE
    assert caught.value.allowed == {State.FAULT}


def test_release_reset_and_activation_bring_the_hand_back(bench: Bench) -> None:
    bench.moved(200)
    bench.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    bench.step()
    bench.controller.release()
    bench.step()
    assert bench.state is State.WF_ATR
    bench.until(lambda: bench.state is State.ATR_DONE, 60)
    assert bench.gripper.position(A) <= 7
    bench.controller.reset()
    bench.until(lambda: bench.state is State.RESET)
    bench.controller.activate()
    bench.until(lambda: bench.state is State.RUNNING_IDLE)
    bench.moved(100, A)


def test_a_release_must_not_activate_a_gripper_that_is_reset() -> None:
    bench = Bench()
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    bench.connect()
    assert bench.state is State.FAULT
    with pytest.raises(NotActivatedError):
        bench.controller.release()
    bench.run(0.1)
    assert not bench.written


def test_a_reset_ends_moves(bench: Bench) -> None:
    _, outcome = bench.move(255)
    bench.run(0.3)
    bench.controller.reset()
    assert isinstance(outcome.error, MoveSupersededError)
    bench.until(lambda: bench.state is State.RESET)
    assert not bench.gripper.is_moving


def test_an_activation_that_fails_ends_in_fault() -> None:
    bench = Bench()
    bench.gripper.fail_activation = True
    bench.connect()
    bench.until(lambda: bench.state is State.FAULT)
    assert bench.latest.fault is Fault.ACTIVATION_FAULT


@pytest.mark.parametrize("what", ["reset", "release"])
def test_a_sequence_begun_while_a_write_is_on_the_line(bench: Bench, what: str) -> None:
    if what == "release":
        bench.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        bench.run(0.1)
        pending = bench.halt()
    else:
        pending = bench.command(A, position=200)
    bench.now += POLL_S
    request = bench.controller.decide(bench.now)
    assert request is not None
    (bench.controller.reset if what == "reset" else bench.controller.release)()
    assert isinstance(pending.error, MoveSupersededError)
    bench.gripper.write(0, request.registers)
    bench.controller.acknowledged(bench.now)
    assert bench.state in (State.DO_RESET, State.DO_ATR), "its own request has not been sent yet"
    bench.controller.see(bench.status())
    bench.until(lambda: bench.state in (State.RESET, State.ATR_DONE))


def test_a_power_cycle_in_mid_activation_ends_in_reset() -> None:
    bench = Bench()
    bench.connect()
    bench.run(1.0)
    bench.gripper.power_cycle()
    bench.run(0.1)
    assert bench.state is State.RESET


def test_a_gripper_found_in_fault_is_left_there() -> None:
    bench = Bench()
    bench.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    bench.connect()
    bench.run(0.5)
    assert bench.state is State.FAULT
    assert not bench.written


# -- the end -----------------------------------------------------------------------------------------------


def shut_down(bench: Bench) -> None:
    bench.controller.stop()
    bench.controller.shut_down()
    bench.until(lambda: not bench.controller.machine.is_busy, 1.0)


def test_the_shutdown_stops_the_fingers_and_keeps_the_activation(bench: Bench) -> None:
    _, outcome = bench.move(255)
    bench.run(0.5)
    shut_down(bench)
    assert isinstance(outcome.error, NotStartedError)
    assert not bench.gripper.is_moving
    image = Request.from_registers(bench.written[-1])
    assert (image.activate, image.go) == (True, False)


def test_the_shutdown_waits_for_the_echo_of_the_complete_last_image() -> None:
    bench = Bench(device_cycle=0.1)
    bench.start()
    bench.command(A, position=200)
    bench.step()
    shut_down(bench)
    assert not bench.latest.go_echo
    assert bench.latest.requested_position(A) == 200


def test_the_shutdown_takes_back_an_activation_of_ours() -> None:
    bench = Bench()
    bench.connect()
    bench.run(1.0)
    assert bench.gripper.is_moving
    shut_down(bench)
    assert not bench.gripper.is_moving


def test_the_shutdown_writes_nothing_when_nothing_goes(bench: Bench) -> None:
    writes = len(bench.written)
    shut_down(bench)
    assert len(bench.written) == writes


def test_the_shutdown_never_activates_a_gripper_that_was_power_cycled_unnoticed(bench: Bench) -> None:
    bench.command(A, position=200)
    bench.step(answer=False)
    bench.gripper.power_cycle()
    bench.now += 0.01
    bench.controller.stop()
    bench.controller.status = bench.status()
    bench.controller.shut_down()
    assert bench.controller.machine.is_busy, "the write that was not acknowledged may still act"
    bench.run(0.5)
    assert not bench.gripper.is_moving
    assert not bench.latest.activation_echo


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("code", [0x09, 0x0A, 0x0E])
def test_halt_in_fault_is_told_while_the_fault_lasts(bench: Bench, code: int, moving: bool) -> None:
    if moving:
        bench.move(255)
        bench.run(0.5)
    bench.gripper.inject_fault(code)
    bench.run(0.1)
    assert bench.state is State.FAULT
    halted = bench.halt()
    bench.until(lambda: halted.is_told, 0.7)
    assert halted.told == [None]
    assert not bench.latest.go_echo


def test_what_waits_in_fault_is_not_written_to_a_gripper_that_lost_its_activation(bench: Bench) -> None:
    """A hold or a halt carries rACT = 1: written after a power cycle it would activate."""
    bench.move(255)
    bench.run(0.5)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    bench.step()
    assert bench.state is State.FAULT
    halted = bench.halt()
    writes = len(bench.written)
    bench.gripper.power_cycle()
    bench.controller.see(bench.status())
    assert isinstance(halted.error, NotActivatedError)
    bench.run(0.5)
    assert bench.state is State.RESET
    assert len(bench.written) == writes
    assert not bench.gripper.is_moving
