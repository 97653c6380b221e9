"""The end: the fingers are stopped, and nothing else changes."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import Fault, Finger, Mode, NotStartedError, State
from robotiq_async.values.request import Request
from tests.control.other_client import activated_by_another, asked, image
from tests.control.scan import POLL_S, Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_the_shutdown_waits_for_the_echo_of_the_complete_last_image() -> None:
    scan = started(0.1)
    scan.command(A, position=200)
    scan.step()
    scan.stop()
    assert not scan.latest.go_echo
    assert scan.latest.requested_position(A) == 200


def test_the_shutdown_writes_nothing_when_nothing_goes(scan: Scan) -> None:
    writes = len(scan.written)
    scan.stop()
    assert len(scan.written) == writes


def test_the_shutdown_never_activates_a_gripper_that_was_power_cycled_unnoticed(scan: Scan) -> None:
    scan.command(A, position=200)
    scan.step(answer=False)
    scan.gripper.power_cycle()
    scan.now += 0.01
    scan.controller.refuse_requests()
    scan.controller.status = scan.status()
    scan.controller.stop_fingers()
    assert scan.controller.is_busy, "the write that was not acknowledged may still act"
    scan.run(0.5)
    assert not scan.gripper.is_moving
    assert not scan.latest.activation_echo


def test_the_shutdown_takes_back_an_activation_of_ours() -> None:
    scan = Scan()
    scan.connect()
    scan.run(1.0)
    assert scan.gripper.is_moving
    scan.stop()
    assert not scan.gripper.is_moving


@pytest.mark.parametrize("device_cycle", [0.005, 0.05])
@pytest.mark.parametrize("keep_grip", [False, True])
def test_a_stop_in_a_fault_takes_back_the_activation_that_it_began(
    device_cycle: float, keep_grip: bool
) -> None:
    """Another client reset the gripper because of the fault, just before our image with rACT."""
    scan = started(device_cycle)
    scan.command(A, position=255, speed=0)
    scan.run(1.0)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.run(1.0)
    before = scan.gripper.travel(B)
    scan.gripper.write(0, [0x0000])
    scan.now += device_cycle / 2
    scan.stop(keep_grip=keep_grip)
    scan.now += 20
    assert not scan.status().activation_echo
    assert scan.gripper.travel(B) - before < 20


def test_the_shutdown_takes_back_an_activation_of_ours_that_began_after_the_link_was_back() -> None:
    """A reset reported before the write acts is from before it."""
    scan = Scan(device_cycle=0.2)
    scan.connect(activate=False)
    scan.run(0.3)
    scan.controller.activate()
    scan.step()
    scan.blink(away=0.01)
    assert scan.state is State.RESET
    scan.run(0.5)
    assert scan.state is State.WF_ACTIVATION
    scan.stop()
    assert not scan.status().activation_echo


def test_the_shutdown_takes_back_an_activation_whose_image_the_gripper_had_before_its_power_cut() -> None:
    """It was reset by the cut: an equal image from before it proves nothing of the one that acts."""
    scan = started(device_cycle=0.2)
    scan.gripper.power_cycle()
    scan.until(lambda: scan.state is State.RESET)
    scan.controller.activate()
    scan.step()
    assert scan.written[-1] == scan.written[0]
    scan.step()
    scan.stop()
    scan.run(0.5)
    assert not scan.status().activation_echo


def test_stop_leaves_the_activation_of_others_alone() -> None:
    scan = activated_by_another()
    pinch = Request(activate=True, go=True, individual_scissor=False, mode=Mode.PINCH, axes=asked(100))
    scan.gripper.write(0, pinch.registers)
    scan.come_back(0.2)
    scan.run(0.05)
    assert scan.state is State.WF_ACTIVATION, "it changes its mode"
    scan.stop()
    assert scan.status().activation_echo


def test_stop_does_not_take_back_an_activation_that_never_arrived_and_that_others_have_begun_since() -> None:
    scan = Scan()
    scan.connect(activate=False)
    scan.controller.activate()
    scan.now += POLL_S
    assert scan.controller.decide(scan.now) is not None  # it never arrives
    scan.blink()
    scan.run(60)
    assert scan.state is State.RESET
    scan.gripper.write(0, [0x0100])
    scan.run(0.5)
    scan.stop()
    assert scan.status().activation_echo


def test_the_shutdown_clears_rgto_and_changes_nothing_else(scan: Scan) -> None:
    _, outcome = scan.move(200, A, speed=7, force=9)
    scan.run(0.5)
    before = scan.last_image
    scan.stop()
    assert isinstance(outcome.error, NotStartedError)
    assert scan.last_image == replace(before, go=False)


def test_the_shutdown_leaves_what_another_client_has_just_asked(scan: Scan) -> None:
    """Its request has not been seen before: from ours the fingers would be sent back."""
    scan.moved(100, A)
    scan.gripper.write(0, image({A: 90, B: 80, C: 70, S: 60}))
    scan.now += 0.05
    scan.stop()
    assert not scan.gripper.is_moving
    asked = [scan.last_image.position(axis) for axis in (A, B, C, S)]
    assert asked == [90, 80, 70, 60]
    assert not scan.last_image.go


def test_a_shutdown_without_an_answer_ends_in_time(scan: Scan) -> None:
    scan.controller.refuse_requests()
    scan.controller.stop_fingers()
    scan.controller.close()
    assert scan.state is State.SHUTDOWN
    assert not scan.controller.is_busy
    with pytest.raises(NotStartedError):
        scan.command(A, position=3)
