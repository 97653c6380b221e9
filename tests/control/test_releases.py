"""Automatic releases that another client ends, or a stop."""

from __future__ import annotations

import pytest

from robotiq_async import Fault, Finger, State
from robotiq_async.control.ledger import Ledger
from robotiq_async.values.enums import NO_AXES
from robotiq_async.values.request import Request
from tests.control.scan import Scan, first_request
from tests.register_words import status_of


@pytest.fixture
def releasing(scan: Scan) -> Scan:
    """A gripper whose fingers open, and which has reported it."""
    scan.moved(200)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    scan.until(lambda: scan.latest.fault is Fault.AUTOMATIC_RELEASE)
    assert scan.state is State.WF_ATR
    return scan


def reset_and_activated_unseen(scan: Scan, seconds: float) -> None:
    """Reset and activate it by another client between two polls; the next one is so many seconds later."""
    scan.gripper.write(0, [0x0000])
    scan.now += 0.02
    scan.gripper.status_registers()
    scan.gripper.write(0, [0x0100])
    scan.now += seconds


@pytest.mark.parametrize(("seconds", "state"), [(1.0, State.WF_ACTIVATION), (20.0, State.RUNNING_IDLE)])
def test_a_release_ends_at_once_when_another_client_has_reset_and_activated_the_gripper(
    releasing: Scan, seconds: float, state: State
) -> None:
    """The hand waited in WF_ATR until the time for the release was over, and for ever after that."""
    reset_and_activated_unseen(releasing, seconds)
    releasing.step()
    assert releasing.state is state
    releasing.until(lambda: releasing.state is State.RUNNING_IDLE)
    releasing.moved(100, Finger.A)
    assert not any(Request.from_registers(image).release for image in releasing.written[-1:])


def test_a_release_ends_at_once_in_the_fault_that_an_activation_has_come_to_meanwhile(
    releasing: Scan,
) -> None:
    releasing.gripper.fail_activation = True
    reset_and_activated_unseen(releasing, 20.0)
    releasing.step()
    assert releasing.latest.fault is Fault.ACTIVATION_FAULT
    assert releasing.state is State.FAULT


@pytest.mark.parametrize("seconds", [1.0, 20.0])
def test_a_release_that_was_never_seen_to_begin_ends_too(scan: Scan, seconds: float) -> None:
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    scan.step()
    assert scan.state is State.WF_ATR
    assert scan.latest.fault is Fault.SCISSOR_BLOCKED
    reset_and_activated_unseen(scan, seconds)
    scan.step()
    assert scan.state in (State.WF_ACTIVATION, State.RUNNING_IDLE)


def test_a_release_that_the_gripper_forgets_is_not_called_a_reset(
    scan: Scan, caplog: pytest.LogCaptureFixture
) -> None:
    scan.gripper.inject_fault(Fault.SCISSOR_INTERFERENCE, 0.2)
    scan.step()
    scan.forgets = 1
    scan.controller.release()
    scan.run(1.5)
    assert scan.state is State.RUNNING_IDLE
    assert "does not show the automatic release" in caplog.text
    assert "was reset" not in caplog.text


def test_a_shutdown_after_a_release_that_another_client_ended_does_not_release_again(releasing: Scan) -> None:
    """The last image has rATR set, and matches the status: rATR has no echo."""
    reset_and_activated_unseen(releasing, 20.0)
    releasing.step()
    releasing.gripper.write(0, [0x0900])
    releasing.run(0.1)
    written = len(releasing.written)
    releasing.stop()
    assert len(releasing.written) == written + 1
    assert not releasing.last_image.release
    assert not releasing.gripper.is_moving


def test_a_release_that_is_called_off_leaves_the_hand_where_the_gripper_is(scan: Scan) -> None:
    """The gripper gets reset before the release is written, and a fault stays: so did WF_ATR."""
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    written = len(scan.written)
    scan.gripper.write(0, [0x0000])
    scan.now += 0.02
    scan.gripper.status_registers()
    scan.gripper.inject_fault(Fault(0x0C))
    scan.step()
    assert len(scan.written) == written
    assert (scan.state, scan.latest.activation_echo) == (State.FAULT, False)
    scan.run(1.0)
    assert len(scan.written) == written
    assert scan.state is State.FAULT


def stands(scan: Scan) -> bool:
    before = scan.travels()
    scan.now += 10
    return scan.travels() == before


@pytest.mark.parametrize("keep_grip", [False, True])
def test_a_stop_ends_our_release_by_a_reset(releasing: Scan, keep_grip: bool) -> None:
    """The fingers opened for seconds after stop() had returned."""
    releasing.stop(keep_grip=keep_grip)
    assert releasing.status().is_reset
    assert stands(releasing)


def test_a_stop_ends_a_release_that_has_just_been_written(scan: Scan) -> None:
    scan.moved(200)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.step()
    scan.controller.release()
    scan.step()
    assert scan.latest.fault is Fault.SCISSOR_BLOCKED, "it does not show"
    scan.stop()
    assert stands(scan)


def test_a_stop_of_the_next_session_ends_it_too(releasing: Scan) -> None:
    later = Scan(after=releasing, goes_on=True)
    later.connect(activate=False)
    later.stop()
    assert stands(later)


def test_a_stop_leaves_the_release_of_another_client_alone(scan: Scan) -> None:
    scan.moved(200)
    scan.gripper.write(0, [0x1900])
    scan.until(lambda: scan.latest.fault is Fault.AUTOMATIC_RELEASE)
    scan.stop()
    assert scan.last_image.activate
    assert not stands(scan)


def test_a_stop_after_our_release_resets_nothing(releasing: Scan) -> None:
    releasing.until(lambda: releasing.state is State.ATR_DONE, 60)
    releasing.stop()
    assert releasing.status().activation_echo


def test_a_stop_after_a_release_that_the_gripper_forgot_resets_nothing(scan: Scan) -> None:
    scan.gripper.inject_fault(Fault.SCISSOR_INTERFERENCE, 0.2)
    scan.step()
    scan.forgets = 1
    scan.controller.release()
    scan.run(1.5)
    scan.stop()
    assert scan.status().is_activated


def test_a_stop_leaves_the_activation_alone_by_which_another_client_has_ended_our_release(
    releasing: Scan,
) -> None:
    reset_and_activated_unseen(releasing, 1.0)
    releasing.gripper.write(0, [0x0900])
    releasing.run(0.1)
    assert releasing.state is State.WF_ACTIVATION
    assert releasing.latest.go_echo, "there is something to stop"
    releasing.stop()
    assert releasing.status().activation_echo


def test_a_release_lasts_while_its_fault_shows_whatever_gimc_says() -> None:
    ledger, at = Ledger(first_request()), 1.0
    ledger.update(status_of(0x31, fault=Fault.SCISSOR_BLOCKED), at)
    ledger.adopt(status_of(0x31, fault=Fault.SCISSOR_BLOCKED))
    ledger.write(Request(activate=True, release=True), NO_AXES, at, begins=True)
    ledger.acknowledge(at)
    ledger.update(status_of(0x31, fault=Fault.AUTOMATIC_RELEASE), at + 1)
    assert ledger.begun is not None
    ledger.update(status_of(0x31), at + 1.1)
    assert ledger.begun is None
