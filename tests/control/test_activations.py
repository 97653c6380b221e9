"""Activations, resets and releases: how they go, and what they must not begin from."""

from __future__ import annotations

import pytest

from robotiq_async import Fault, Finger, MoveSupersededError, NotActivatedError, State
from robotiq_async.values.enums import Trigger
from robotiq_async.values.request import Request
from tests.control.other_client import going_to, reset_and_activated_by_another
from tests.control.scan import POLL_S, Scan

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_activation_from_reset_goes_through_its_states_and_never_shows_reset(scan: Scan) -> None:
    assert [target for _, target, _ in scan.transitions] == [
        State.DO_ACTIVATION,
        State.WF_ACTIVATION,
        State.RUNNING_IDLE,
    ]
    assert scan.last_image.go is False


def test_an_activation_is_called_off_when_others_have_activated_meanwhile() -> None:
    scan = Scan()
    scan.connect(activate=False)
    scan.gripper.place_object(Finger.ABC, 150)
    scan.gripper.write(0, [0x0100])
    scan.now += 6
    scan.gripper.write(0, going_to(255))
    scan.now += 3
    scan.controller.activate()
    scan.step()  # a beginning is decided on the gripper's present status
    assert scan.state is State.RUNNING_IDLE
    scan.run(1)
    assert not scan.written
    assert scan.latest.contacts == Finger.ABC


def test_an_activation_that_never_shows_fails_and_can_be_tried_again() -> None:
    """The gripper forgets the write, or another client takes it back: the hand waited in WF_ACTIVATION."""
    scan = Scan()
    scan.connect(activate=False)
    scan.forgets = 1
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RESET, 1.5)
    assert len(scan.written) == 1, "it is not sent again by itself"
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)


def test_a_halt_right_after_an_activation_that_was_called_off_lets_nothing_go() -> None:
    """It was made from an image in which rACT had never been set, and so reset the gripper."""
    scan = Scan()
    scan.connect(activate=False)
    scan.gripper.place_object(Finger.ABC, 150)
    scan.gripper.write(0, [0x0100])
    scan.now += 6
    scan.gripper.write(0, going_to(255))
    scan.now += 3
    scan.controller.activate()
    scan.step()
    scan.halt()
    request = scan.controller.decide(scan.now)
    assert request is not None
    assert (request.activate, request.go) == (True, False)


def test_a_stop_after_a_lost_link_writes_what_the_gripper_has() -> None:
    """An adopted gripper's requests were forgotten with the link, and the first image of all was written."""
    scan = Scan()
    scan.gripper.write(0, Request(activate=True).registers)
    scan.now += 10
    scan.gripper.write(0, going_to(200))
    scan.come_back(1)
    scan.run(0.1)
    scan.controller.lost(None)
    scan.now += 1
    scan.controller.refuse_requests()
    scan.see()
    scan.controller.stop_fingers()
    scan.step()
    assert [request.position for request in scan.last_image.axes[:3]] == [200, 200, 200]


@pytest.mark.parametrize("how", ["position", "speed"])
def test_another_client_that_writes_during_our_activation_is_noticed_at_its_end(how: str) -> None:
    scan = Scan()
    scan.gripper.place_object(Finger.ABC, 150)
    scan.connect()
    scan.run(1)
    scan.gripper.write(0, going_to(200))
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert scan.controller.foreign_commands == 1
    scan.run(5)  # its fingers grip
    if how == "position":
        scan.moved(180, B)
        scan.run(3)
        assert scan.positions()[A] == 150
    else:
        scan.command(B, speed=10)
        scan.run(1)
        assert scan.latest.go_echo


# -- resets and releases ---------------------------------------------------------------------------------


@pytest.mark.parametrize("what", ["reset", "release"])
def test_a_sequence_begun_while_a_write_is_on_the_line(scan: Scan, what: str) -> None:
    if what == "release":
        scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        scan.run(0.1)
        pending = scan.halt()
    else:
        pending = scan.command(A, position=200)
    scan.now += POLL_S
    request = scan.controller.decide(scan.now)
    assert request is not None
    (scan.controller.reset if what == "reset" else scan.controller.release)()
    scan.answer_ended()
    assert isinstance(pending.error, MoveSupersededError)
    scan.gripper.write(0, request.registers)
    scan.controller.acknowledged(scan.now)
    assert scan.state in (State.DO_RESET, State.DO_ATR), "its own request has not been sent yet"
    scan.see()
    scan.until(lambda: scan.state in (State.RESET, State.ATR_DONE))


def test_a_release_must_not_activate_a_gripper_that_is_reset() -> None:
    scan = Scan()
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    scan.connect()
    assert scan.state is State.FAULT
    with pytest.raises(NotActivatedError):
        scan.controller.release()
    scan.run(0.1)
    assert not scan.written


def test_after_a_release_and_another_clients_reset_no_command_releases_again(scan: Scan) -> None:
    scan.moved(100)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.run(0.05)
    scan.controller.release()
    scan.until(lambda: scan.state is State.ATR_DONE, 60)
    reset_and_activated_by_another(scan)
    written = len(scan.written)
    scan.moved(60, B)
    assert not any(Request.from_registers(image).release for image in scan.written[written:])


def test_a_gripper_that_is_active_or_activating_is_not_activated_again(scan: Scan) -> None:
    written = len(scan.written)
    scan.controller.activate()
    scan.run(0.1)
    assert len(scan.written) == written
    assert not scan.controller.is_busy
    scan.controller.reset()
    scan.until(lambda: scan.state is State.RESET)
    scan.controller.activate()
    scan.run(0.1)
    written = len(scan.written)
    scan.controller.activate()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert len(scan.written) == written


def test_a_halt_ends_an_activation_as_a_reset_does() -> None:
    scan = Scan()
    scan.connect()
    scan.run(1)
    assert scan.gripper.is_moving
    scan.controller.reset(Trigger.ASK_HALT)
    scan.controller.reset()  # it is about to be sent already
    scan.until(lambda: scan.state is State.RESET)
    assert not scan.gripper.is_moving
    assert [trigger for _, target, trigger in scan.transitions if target is State.DO_RESET] == [
        Trigger.ASK_HALT
    ]
