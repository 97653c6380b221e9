"""Answers to requests that cross: a halt among commands, a fault, a lost link."""

from __future__ import annotations

import pytest

from robotiq_async import ConnectionLostError, Fault, Finger, GripperFaultError, MoveSupersededError, State
from robotiq_async.control.pending import changes
from robotiq_async.values.model import THREE_FINGER
from tests.control.scan import POLL_S, Scan, started

A, B, C, S = THREE_FINGER.axes


def moving(device_cycle: float = 0.005) -> Scan:
    """Every finger closes slowly."""
    scan = started(device_cycle)
    scan.command(Finger.ABC, position=255, speed=0)
    scan.run(1.0)
    return scan


def test_a_halt_goes_before_what_was_asked_with_it() -> None:
    scan = moving()
    setter = scan.command(A, speed=50)
    halter = scan.halt()
    scan.command(B, position=100)
    scan.step()
    assert not scan.last_image.go
    assert scan.last_image.axes[0].speed == 0, "the speed follows"
    assert not setter.is_answered
    assert not halter.is_answered, "nothing shows that it acts"
    scan.run(0.1)
    assert halter.answers == setter.answers == [None]
    assert scan.last_image.go
    assert (scan.last_image.axes[0].speed, scan.last_image.position(B)) == (50, 100)


def test_a_halt_covers_every_hold_and_answers_its_callers() -> None:
    """The hold alone would leave nothing to write, and no call would end."""
    scan = moving()
    before = scan.hold(A)
    scan.halt()
    after = scan.hold(B)
    writes = len(scan.written)
    scan.step()
    assert len(scan.written) == writes + 1
    assert before.answers == after.answers == [None]


def test_every_caller_of_halt_has_an_answer_and_a_second_halt_of_its_own_is_sent() -> None:
    scan = moving(device_cycle=0.05)
    one, other = scan.halt(), scan.halt()
    scan.step()
    writes = len(scan.written)
    late = scan.halt()
    scan.step()
    assert len(scan.written) == writes + 1
    scan.run(0.2)
    assert one.answers == other.answers == late.answers == [None]


@pytest.mark.parametrize("second", ["position", "halt"])
def test_a_hold_that_was_not_delivered_outlives_what_went_before_it(second: str) -> None:
    """A position of the same axis is dropped with the link, a stop is not, and a halt becomes a hold."""
    scan = moving()
    holder = scan.hold(A)
    if second == "position":
        scan.command(A, position=250)
    else:
        scan.halt()
    scan.now += POLL_S
    scan.controller.lost(None)
    assert isinstance(holder.error, ConnectionLostError)
    scan.come_back(0.05)
    at = scan.gripper.position(A)
    scan.run(1.0)
    assert scan.gripper.position(A) <= at + 3
    assert (scan.gripper.position(B) > at + 10) is (second == "position"), "only a halt asks B to stop"


def test_a_request_that_failed_on_the_line_is_not_answered_again() -> None:
    scan = started()
    asking = scan.command(A, position=100)
    assert scan.controller.decide(scan.now) is not None
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    scan.answer_ended()
    scan.controller.acknowledged(scan.now)
    assert isinstance(asking.error, MoveSupersededError)


def test_a_hold_on_the_line_is_answered_although_its_client_has_gone() -> None:
    scan = moving()
    holder = scan.hold(A)
    assert scan.controller.decide(scan.now) is not None
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    assert not holder.is_answered
    scan.controller.acknowledged(scan.now)
    assert holder.answers == [None]


def test_a_fault_ends_what_moves_and_not_what_stops() -> None:
    scan = moving()
    asking, holder, halter = scan.command(A, position=100), scan.hold(B), scan.halt()
    setter = scan.command(S, speed=50)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    assert isinstance(asking.error, MoveSupersededError), "the halt came before the fault"
    assert isinstance(setter.error, GripperFaultError)
    scan.run(0.1)
    assert holder.answers == halter.answers == [None]


# -- while a write is on the line ----------------------------------------------------------------------------


def test_a_command_on_the_line_is_delivered_although_a_hold_follows_it() -> None:
    scan = started()
    asking = scan.command(A, position=100)
    assert scan.decide() is not None
    scan.hold(A)
    scan.controller.acknowledged(scan.now)
    assert asking.answers == [None]


def test_the_state_tells_of_a_command_until_it_is_delivered_whether_a_caller_waits_or_not() -> None:
    scan = started()
    scan.controller.command(changes(A, 100))
    assert scan.decide() is not None
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    assert scan.state is State.RUNNING_CC
    scan.controller.acknowledged(scan.now)
    assert scan.state is State.RUNNING_IDLE


def test_a_command_that_is_dropped_while_a_hold_is_on_the_line_leaves_no_trace() -> None:
    scan = started()
    move, _ = scan.move(255, A)
    scan.run(0.5)
    scan.controller.abandon(move)
    assert scan.decide() is not None
    scan.controller.command(changes(A, 100))
    assert scan.state is State.RUNNING_CC
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    assert scan.state is State.RUNNING_IDLE, "the hold is of our own making"


def test_a_hold_on_the_line_is_an_open_stop() -> None:
    scan = moving()
    scan.hold(A)
    assert scan.decide() is not None
    assert scan.controller.has_open_stop
    scan.controller.acknowledged(scan.now)
    assert not scan.controller.has_open_stop


def test_a_hold_on_the_line_keeps_no_second_one_of_its_axes_that_is_dropped() -> None:
    scan = moving()
    scan.hold(A)
    assert scan.decide() is not None
    move, _ = scan.move(100, A)
    scan.controller.abandon(move)
    assert scan.controller.has_request
    scan.controller.drop_requests(MoveSupersededError("its client is gone"))
    assert not scan.controller.has_request
