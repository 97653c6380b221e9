"""Halts: they go at once, stop everything, and end when the gripper reports it."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import ConnectionLostError, Fault, Finger, MoveSupersededError, State, StateTimeoutError
from robotiq_async.values.enums import Initialization, Mode
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from tests.control.other_client import image, moved_by_another, used_by_another
from tests.control.scan import Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_halt_stops_everything_and_ends_moves(scan: Scan) -> None:
    _, outcome = scan.move(255)
    scan.run(0.5)
    halted = scan.halt()
    assert isinstance(outcome.error, MoveSupersededError)
    scan.until(lambda: halted.is_answered)
    assert halted.answers == [None]
    assert not scan.gripper.is_moving
    assert not scan.latest.go_echo


def test_a_command_after_a_halt_moves_only_its_own_axes(scan: Scan) -> None:
    scan.move(255)
    scan.run(0.5)
    scan.halt()
    _, outcome = scan.move(100, A)
    scan.step()
    scan.step()
    travel = {axis: scan.gripper.travel(axis) for axis in (B, C, S)}
    scan.until(lambda: outcome.is_answered)
    scan.run(1.0)
    for axis in (B, C, S):
        assert scan.gripper.travel(axis) - travel[axis] <= 1, axis
    assert scan.gripper.position(A) == pytest.approx(100, abs=2)


@pytest.mark.parametrize("at", [100.0, 139.0])
def test_a_halt_whose_repetition_leaves_just_after_the_spacing_is_over(at: float) -> None:
    """By rounding it counted as early, each time, and was repeated until the polls left that grid."""
    scan = Scan(spacing=0.01)
    scan.now = at
    scan.start()
    scan.command(A, 255)
    scan.step()
    written, halted = len(scan.written), scan.halt()
    scan.hurry()
    scan.run(1.0)
    assert halted.answers == [None]
    assert len(scan.written) == written + 2


def test_the_state_tells_of_a_command_that_waits_for_the_halt_before_it(scan: Scan) -> None:
    halted, waiting = scan.halt(), scan.command(A, 100)
    scan.step()
    assert (halted.is_answered, waiting.is_answered) == (False, False)
    assert scan.state is State.RUNNING_CC
    scan.until(lambda: waiting.is_answered)
    assert halted.is_answered
    assert scan.state is State.RUNNING_IDLE


def test_a_command_after_a_halt_waits_until_a_slow_gripper_has_stopped() -> None:
    scan = started(0.1)
    scan.move(255, speed=255)
    scan.run(0.5)
    scan.halt()
    _, outcome = scan.move(0, A)
    scan.until(lambda: not scan.latest.go_echo)
    travel = {axis: scan.gripper.travel(axis) for axis in (B, C)}
    scan.until(lambda: outcome.is_answered)
    for axis in (B, C):
        assert scan.gripper.travel(axis) - travel[axis] <= 1, axis


def test_halt_drops_what_was_not_sent_yet(scan: Scan) -> None:
    asked = scan.command(A, position=200)
    scan.halt()
    assert isinstance(asked.error, MoveSupersededError)
    scan.run(0.5)
    assert scan.gripper.position(A) <= 7


def test_halt_in_reset_has_nothing_to_do() -> None:
    scan = Scan()
    scan.connect(activate=False)
    assert scan.halt().answers == [None]
    scan.run(0.05)
    assert not scan.written


def test_a_halt_does_not_wait_for_an_axis_to_show_its_direction() -> None:
    scan = used_by_another()
    scan.gripper.write(0, image(dict.fromkeys(THREE_FINGER.axes, 220), speed=0))
    scan.now += 1.0
    scan.connect()
    halted = scan.halt()
    scan.step()
    assert len(scan.written) == 1
    scan.until(lambda: halted.is_answered, 0.05)
    assert halted.answers == [None]
    assert not scan.gripper.is_moving


@pytest.mark.parametrize("moving", [True, False])
@pytest.mark.parametrize("code", [0x09, 0x0A, 0x0E])
def test_halt_in_fault_ends_while_the_fault_lasts(scan: Scan, code: int, moving: bool) -> None:
    if moving:
        scan.move(255)
        scan.run(0.5)
    scan.gripper.inject_fault(code)
    scan.run(0.1)
    assert scan.state is State.FAULT
    halted = scan.halt()
    scan.until(lambda: halted.is_answered, 0.7)
    assert halted.answers == [None]
    assert not scan.latest.go_echo


def test_a_forgotten_halt_is_written_again_if_the_motion_before_it_had_not_begun() -> None:
    """Until that motion acts, gGTO is 0: no status reveals whether the halt has arrived."""
    scan = started(device_cycle=0.2)
    scan.command(A, position=255, speed=0)
    scan.step()
    scan.forgets = 1
    halter = scan.halt()
    scan.step()
    assert not scan.latest.go_echo
    scan.run(0.1)
    assert not halter.is_answered
    scan.until(lambda: halter.is_answered)
    before = scan.travels()
    scan.run(1.0)
    assert scan.travels() == before


def test_a_speed_after_a_halt_waits_until_the_gripper_has_stopped() -> None:
    scan = started(device_cycle=0.2)
    scan.command(A, position=255)
    scan.run(0.5)
    scan.halt()
    setter = scan.command(A, speed=9)
    scan.run(0.1)
    assert not setter.is_answered
    scan.run(0.3)
    assert setter.answers == [None]
    assert (scan.last_image.go, scan.last_image.axes[0].speed) == (False, 9)


def test_a_motion_after_a_halt_at_rest_does_not_wait() -> None:
    """A force that does not act yet sets nothing in motion."""
    scan = started()
    scan.command(A, force=200)
    scan.step()
    halter = scan.halt()
    scan.step()
    scan.command(A, position=100)
    scan.run(0.02)
    assert halter.answers == [None]
    assert scan.last_image.go


def test_a_halt_fails_with_the_link_and_is_not_sent_later() -> None:
    scan = started(device_cycle=0.2)
    scan.command(A, position=255, speed=0)
    scan.run(0.5)
    scan.forgets = 1
    halter = scan.halt()
    scan.step()
    scan.blink()
    assert isinstance(halter.error, ConnectionLostError)
    scan.run(1.0)
    assert scan.last_image.go, "a hold goes in its place, which drops no part"
    assert not scan.gripper.is_moving


def test_a_halt_outlives_a_fault_in_the_same_poll() -> None:
    scan = moved_by_another()
    halted = scan.halt()
    scan.gripper.inject_fault(Fault(0x0C), 0.1)
    scan.see()
    assert scan.state is State.FAULT
    at = scan.positions()[A]
    scan.run(10)
    assert halted.answers == [None]
    assert scan.positions()[A] <= at + 4


def test_a_halt_that_the_gripper_forgets_is_written_once_more(scan: Scan) -> None:
    """A gripper may acknowledge a write and forget it."""
    scan.move(255, speed=0)
    scan.run(0.5)
    halted, before = scan.halt(), len(scan.written)
    scan.forgets = 1
    scan.run(1.5)
    assert halted.answers == [None]
    assert len(scan.written) - before == 2
    assert scan.written[-1] == scan.written[-2]
    assert not scan.gripper.is_moving


def test_a_halt_that_never_shows_fails(scan: Scan, caplog: pytest.LogCaptureFixture) -> None:
    """Its caller took it for stopped while the fingers went on."""
    scan.move(255, speed=0)
    scan.run(0.5)
    halted, before = scan.halt(), len(scan.written)
    scan.forgets = 2
    scan.run(1.5)
    assert scan.gripper.is_moving
    assert len(scan.written) - before == 2
    assert isinstance(halted.error, StateTimeoutError)
    assert "the fingers may still move" in str(halted.error)
    assert str(halted.error) in caplog.text


@pytest.mark.parametrize("pause", [0.3, 0.6, 0.9])
def test_a_halt_that_never_shows_fails_although_it_is_repeated(scan: Scan, pause: float) -> None:
    """Each call began to count anew, so none had an answer."""
    scan.move(255, speed=0)
    scan.run(0.5)
    scan.forgets = 1000
    halts = []
    for _ in range(5):
        halts.append(scan.halt())
        scan.run(pause)
    scan.run(1.5)
    assert scan.gripper.is_moving
    assert [type(each.error) for each in halts] == [StateTimeoutError] * 5


def test_the_first_of_two_halts_fails_in_its_time(scan: Scan) -> None:
    scan.move(255, speed=0)
    scan.run(0.5)
    scan.forgets = 1000
    first = scan.halt()
    scan.run(0.8)
    second = scan.halt()
    scan.run(0.3)
    assert isinstance(first.error, StateTimeoutError)
    assert not second.is_answered, "its own writes have their time"
    scan.forgets = 0
    scan.run(0.7)
    assert second.answers == [None]


@pytest.mark.parametrize("how", ["halt", "stop"])
def test_a_stop_in_a_change_of_mode_of_another_client_resets_nothing(how: str) -> None:
    """It is busy as an activation is; a reset would drop the part."""
    scan = started()
    scan.moved(100)
    now = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, replace(now, mode=Mode.WIDE, individual_scissor=False).registers)
    scan.now += 0.02
    if how == "halt":
        scan.halt()
        image = scan.controller.decide(scan.now)
        assert image is not None
        scan.gripper.write(0, image.registers)
        scan.controller.acknowledged(scan.now)
        scan.step()
        assert scan.latest.initialization is Initialization.CHANGING_MODE
        scan.run(1)
    else:
        scan.stop()
    assert all(Request.from_registers(registers).activate for registers in scan.written[1:])
    assert scan.latest.activation_echo


def test_a_halt_that_joins_one_on_the_line_is_answered_with_it(scan: Scan) -> None:
    scan.move(200, speed=0)
    scan.run(0.1)
    first = scan.halt()
    request = scan.decide()
    assert request is not None
    second = scan.halt()
    scan.gripper.write(0, request.registers)
    scan.controller.acknowledged(scan.now)
    scan.run(0.1)
    assert first.answers == second.answers == [None]
    assert not scan.gripper.is_moving


def test_a_halt_that_came_early_is_not_one_of_the_two() -> None:
    """A gripper may forget a write that comes soon after another one."""
    scan = Scan(spacing=0.01)
    scan.start()
    scan.command(A, position=200, speed=0)
    scan.step()
    halted = scan.halt()
    scan.forgets = 2
    scan.hurry()
    scan.until(lambda: halted.is_answered, 2.0)
    assert halted.answers == [None]
    assert not scan.gripper.is_moving
