"""The end: the fingers are stopped, and nothing else changes."""

from __future__ import annotations

from robotiq_async import Finger, Mode, NotStartedError, State
from robotiq_async.wire.request import Request
from tests.control.other_client import activated_by_another, asked
from tests.control.scan import POLL_S, Scan

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def test_the_shutdown_stops_the_fingers_and_keeps_the_activation(scan: Scan) -> None:
    _, outcome = scan.move(255)
    scan.run(0.5)
    scan.stop()
    assert isinstance(outcome.error, NotStartedError)
    assert not scan.gripper.is_moving
    image = Request.from_registers(scan.written[-1])
    assert (image.activate, image.go) == (True, False)


def test_the_shutdown_waits_for_the_echo_of_the_complete_last_image() -> None:
    scan = Scan(device_cycle=0.1)
    scan.start()
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
    scan.controller.stop()
    scan.controller.status = scan.status()
    scan.controller.shut_down()
    assert scan.controller.machine.is_busy, "the write that was not acknowledged may still act"
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


def test_stop_leaves_the_activation_of_others_alone() -> None:
    scan = activated_by_another()
    pinch = Request(activate=True, go=True, individual_scissor=False, mode=Mode.PINCH, axes=asked(100))
    scan.gripper.write(0, pinch.registers)
    scan.now += 0.2
    scan.connect(activate=False)
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
