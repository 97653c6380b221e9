"""Fault 0x09 after a second without a message: reported once, and no fault; one that lasts is."""

from __future__ import annotations

import logging

import pytest

from robotiq_async import Fault, Finger, GripperFaultError, State
from robotiq_async.control.evidence import LASTS_READS, LASTS_S, Evidence
from robotiq_async.simulator import Habits
from robotiq_async.values.enums import Trigger
from tests.control.other_client import going_to
from tests.control.scan import POLL_S, Scan
from tests.register_words import status_of

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def quiet() -> Scan:
    """A gripper with 0x09 in the first read after a second without a message, which has passed."""
    scan = Scan(habits=Habits(silence_fault=1.0))
    scan.now += 2
    return scan


@pytest.fixture
def silent() -> Scan:
    scan = quiet()
    scan.start()
    return scan


# -- statuses after a silence ------------------------------------------------------------------------------


def test_a_start_looks_past_it_and_activates(silent: Scan) -> None:
    assert [target for _, target, _ in silent.transitions] == [
        State.DO_ACTIVATION,
        State.WF_ACTIVATION,
        State.RUNNING_IDLE,
    ]


def test_a_start_looks_past_it_and_adopts() -> None:
    scan = quiet()
    scan.gripper.write(0, [0x0100])
    scan.now += 10
    scan.gripper.write(0, going_to(200))
    scan.now += 10
    scan.connect()
    assert [target for _, target, _ in scan.transitions] == [State.RUNNING_IDLE]
    scan.run(0.5)
    assert not scan.written


def test_it_decides_nothing_about_a_gripper_before_it_has_looked_past_it() -> None:
    scan = quiet()
    scan.controller.activates = True
    scan.see()
    assert scan.controller.evidence.is_undecided
    assert scan.state is State.DISCONNECTED
    assert scan.controller.decide(scan.now) is None


def test_a_move_goes_on_through_a_loop_that_is_held_up(silent: Scan) -> None:
    _, outcome = silent.move(255, speed=0)
    silent.run(1.0)
    for _ in range(4):
        silent.now += 1.2
        silent.step()
    silent.until(lambda: outcome.is_answered)
    assert all(position >= 240 for position in outcome.result.positions.values())
    assert silent.controller.evidence.passed == 5, "the start, and each time"
    assert State.FAULT not in [target for _, target, _ in silent.transitions]


def test_a_loop_that_is_held_up_at_every_poll_sees_no_fault(silent: Scan) -> None:
    for _ in range(10):
        silent.now += 1.2
        silent.step()
    assert silent.controller.evidence.passed == 10, "the start, and all but the last one, which may last"
    assert silent.state is State.RUNNING_IDLE


def test_on_a_link_so_slow_that_each_read_ends_a_silence_things_are_done() -> None:
    scan = quiet()
    scan.gripper.write(0, [0x0100])
    scan.now += 10
    scan.controller.activates = True
    for _ in range(LASTS_READS):
        assert scan.state is State.DISCONNECTED
        scan.now += 1.2
        scan.see()
    assert scan.state is State.RUNNING_IDLE
    outcome = scan.command(A, position=100)
    scan.now += 1.2
    scan.step()
    assert outcome.answers == [None]
    assert scan.state is State.RUNNING_IDLE


def test_a_reconnect_looks_past_it(silent: Scan) -> None:
    silent.moved(100)
    silent.transitions.clear()
    silent.blink(away=3.0)
    assert [target for _, target, _ in silent.transitions] == [State.DISCONNECTED, State.RUNNING_IDLE]


@pytest.mark.parametrize("how", ["command", "hold", "activate", "reset"])
def test_requests_after_a_silence_are_carried_out(silent: Scan, how: str) -> None:
    silent.run(0.1)
    if how == "activate":
        silent.controller.reset()
        silent.until(lambda: silent.state is State.RESET)
    silent.now += 1.5
    match how:
        case "command":
            silent.moved(100)
        case "hold":
            assert silent.hold().answers == []
            silent.step()
        case "activate":
            silent.controller.activate()
            silent.until(lambda: silent.state is State.RUNNING_IDLE)
        case "reset":
            silent.controller.reset()
            silent.until(lambda: silent.state is State.RESET)
    assert State.FAULT not in [target for _, target, _ in silent.transitions]


def test_a_grip_is_kept_after_a_silence(silent: Scan) -> None:
    silent.gripper.place_object(B | C, 150)
    silent.moved(255, B | C)
    silent.run(0.5)
    silent.now += 1.5
    silent.stop(keep_grip=True)
    assert silent.gripper.grips == B | C


def test_it_is_logged_once(silent: Scan, caplog: pytest.LogCaptureFixture) -> None:
    caplog.set_level(logging.INFO)
    before = silent.controller.evidence.passed
    for _ in range(3):
        silent.now += 1.2
        silent.run(0.1)
    assert silent.controller.evidence.passed == before + 3
    assert caplog.text.count("0x09") == (before == 0)


# -- what lasts --------------------------------------------------------------------------------------------


def test_a_lasting_0x09_is_a_fault_after_some_reads(silent: Scan) -> None:
    _, outcome = silent.move(255)
    silent.run(0.5)
    silent.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2.0)
    took = silent.until(lambda: outcome.is_answered)
    assert took <= (LASTS_READS + 1) * POLL_S
    assert isinstance(outcome.error, GripperFaultError)
    assert silent.state is State.FAULT
    assert silent.controller.evidence.passed == 1, "that of the start"


@pytest.mark.parametrize("how", ["command", "activate"])
def test_under_one_that_lasts_nothing_is_begun(silent: Scan, how: str) -> None:
    silent.run(0.1)
    if how == "activate":
        silent.controller.reset()
        silent.until(lambda: silent.state is State.RESET)
    silent.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    written = len(silent.written)
    outcome = None
    if how == "activate":
        silent.controller.activate()
    else:
        outcome = silent.command(A, position=100)
    silent.until(lambda: silent.state is State.FAULT, 0.1)
    assert len(silent.written) == written
    assert outcome is None or isinstance(outcome.error, GripperFaultError)


def test_a_hold_and_a_halt_do_not_wait_for_it(silent: Scan) -> None:
    for stop in (silent.hold, silent.halt):
        silent.move(255 if stop == silent.hold else 0, speed=0)
        silent.run(0.5)
        silent.now += 1.2
        written = len(silent.written)
        stop()
        silent.step()
        assert len(silent.written) == written + 1


def test_a_lasting_0x09_at_the_start_leaves_the_hand_in_fault() -> None:
    scan = quiet()
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2.0)
    scan.connect()
    assert scan.state is State.FAULT
    assert not scan.written


def test_it_does_not_clear_another_fault(silent: Scan) -> None:
    silent.gripper.inject_fault(Fault(0x0C))
    silent.run(0.1)
    assert silent.state is State.FAULT
    silent.now += 1.2
    silent.step()
    assert silent.state is State.FAULT


@pytest.mark.parametrize(
    ("at", "shown"),
    [
        ([0.0], [True]),
        ([0.0, LASTS_S, 2 * LASTS_S], [True, True, False]),
        ([0.0, LASTS_S / 2, LASTS_S], [True, True, False]),
        ([0.0, 0.001, 0.002, 0.003], [True] * 4),  # some time, too
        ([0.0, 0.1, 0.2], [True, True, False]),  # a slow poll
        ([0.0, 1.2, 2.4, 3.6], [True] * 4),  # each after a silence
        ([0.0, 1.2, 1.21, 1.22], [True, True, True, False]),  # since the last silence
    ],
)
def test_it_takes_some_reads_and_some_time_without_a_silence(at: list[float], shown: list[bool]) -> None:
    evidence = Evidence()
    judged = [evidence.judged(status_of(0x31, 0xFF, 0x09, at=time), time) for time in at]
    assert [each.fault is Fault.NONE for each in judged] == shown


def test_without_it_the_first_status_decides() -> None:
    evidence = Evidence()
    assert not evidence.passing.is_open
    assert evidence.update(status_of(0x31, 0xFF, at=0.0), 0.0) is Trigger.SEEN_READY
    assert not evidence.is_undecided


@pytest.mark.parametrize("code", [0x00, 0x05, 0x0A, 0x0C, 0x0E])
def test_every_other_status_is_what_it_is(code: int) -> None:
    status = status_of(0x31, 0xFF, code)
    assert Evidence().judged(status, 0.0) is status
