"""The log of what decides: why axes are held, what a halt resets, and what the last hand has left."""

from __future__ import annotations

import logging
from collections.abc import Callable

import pytest

from robotiq_async import Fault, Finger, State
from robotiq_async.values.enums import Trigger
from tests.control.scan import Scan, started

A = Finger.A


@pytest.fixture(autouse=True)
def log_of_all(caplog: pytest.LogCaptureFixture) -> pytest.LogCaptureFixture:
    caplog.set_level(logging.INFO, logger="robotiq_async")
    return caplog


def fault(scan: Scan) -> None:
    scan.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    scan.until(lambda: scan.state is State.FAULT)


def given_up(scan: Scan) -> None:
    move, _ = scan.move(20, A)
    scan.controller.abandon(move, unseen=True)


def lost_halt(scan: Scan) -> None:
    scan.halt()
    scan.step(answer=False)


def taken_over(scan: Scan) -> None:
    scan.hold(A)


@pytest.mark.parametrize(
    ("happens", "why"),
    [
        (fault, f"the gripper reports {Fault.COMMUNICATION_NOT_READY.description}"),
        (given_up, "a move was given up"),
        (lost_halt, "a stop was lost with the link: once it is back"),
        (taken_over, ""),
    ],
)
def test_a_hold_that_no_caller_has_asked_for_tells_its_reason(
    scan: Scan, caplog: pytest.LogCaptureFixture, happens: Callable[[Scan], None], why: str
) -> None:
    scan.move(200, A, speed=0)
    scan.run(0.1)
    happens(scan)
    told = [each.message for each in caplog.records if "the moving axes of" in each.message]
    assert [each.partition(": the moving axes of ")[0] for each in told] == ([why] if why else [])


def test_a_halt_that_is_a_reset_tells_so(scan: Scan, caplog: pytest.LogCaptureFixture) -> None:
    scan.controller.reset(Trigger.HALT_RESETS)
    assert f"RUNNING_IDLE -> DO_RESET ({Trigger.HALT_RESETS.value})" in caplog.text


def test_what_the_last_hand_has_left_on_its_way_is_told_with_its_image(
    caplog: pytest.LogCaptureFixture,
) -> None:
    first = started(0.1)
    first.command(A, position=123)
    first.step()
    told = "the last hand of this gripper has left a request on its way"
    assert told not in caplog.text
    Scan(after=first, goes_on=True)
    (message,) = [each.message for each in caplog.records if told in each.message]
    assert "position=123" in message
