"""An activation or a release that a fault or a lost link has not ended: a stop ends it, by a reset."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import Fault, Finger, Inhibit, Mode, State
from robotiq_async.values.enums import Trigger
from robotiq_async.values.request import Request
from tests.control.scan import POLL_S, Scan, started

INHIBIT = Inhibit("the guard is open", "PLC", 1.0)
ACTIVATE = [0x0100]


def activating() -> Scan:
    """Some time after this hand has begun an activation."""
    scan = Scan()
    scan.connect()
    scan.run(1.0)
    assert scan.gripper.is_moving
    return scan


def releasing() -> Scan:
    """Some time after this hand has begun an automatic release."""
    scan = started()
    scan.moved(100)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.run(0.05)
    scan.controller.release()
    scan.run(0.5)
    return scan


def is_reset_at_once(scan: Scan, travel: int = 10) -> None:
    """It is reset without a request, and no finger goes on."""
    before = scan.travels()
    scan.until(lambda: scan.state is State.RESET, 1.0)
    scan.run(30.0)
    assert not scan.latest.activation_echo
    assert all(there - before[axis] < travel for axis, there in scan.travels().items())


# -- a link that comes back while motion is inhibited ----------------------------------------------------


@pytest.mark.parametrize("fault", [None, Fault.SCISSOR_BLOCKED], ids=str)
def test_an_activation_that_runs_as_the_link_is_back_is_reset_while_inhibited(fault: Fault | None) -> None:
    """Only a hold was kept for that, which ends no activation: 428 counts."""
    scan = activating()
    scan.controller.lost(None, scan.now)
    scan.machine.inhibit(INHIBIT)
    scan.controller.end_inhibited()
    if fault is not None:
        scan.gripper.inject_fault(fault, 0.5)
    scan.come_back(0.05)
    is_reset_at_once(scan)


@pytest.mark.parametrize("halted", [True, False])
def test_a_release_that_runs_as_the_link_is_back_is_reset_while_inhibited(halted: bool) -> None:
    """The reset of an inhibit was lost with the link, or was never sent."""
    scan = releasing()
    scan.machine.inhibit(INHIBIT)
    if halted:
        scan.controller.reset()
    scan.blink()
    assert scan.gripper.is_moving
    is_reset_at_once(scan)


def test_an_activation_whose_write_may_still_act_as_the_link_is_back_is_reset_while_inhibited() -> None:
    scan = Scan(device_cycle=0.2)
    scan.connect(activate=False)
    scan.controller.activate()
    scan.step(answer=False)
    scan.machine.inhibit(INHIBIT)
    scan.come_back(0.01)
    scan.run(1.0)
    assert scan.state is State.RESET
    assert not scan.latest.activation_echo


def test_a_hand_that_starts_inhibited_resets_the_activation_that_it_finds() -> None:
    """Its program was killed during that, with the inhibit on record: 405 counts."""
    scan = Scan()
    scan.gripper.write(0, ACTIVATE)
    scan.now += 1.0
    scan.machine.inhibit(INHIBIT)
    scan.connect()
    is_reset_at_once(scan)


def test_a_link_that_comes_back_while_inhibited_leaves_all_else_alone() -> None:
    """A change of mode keeps what the hand holds: a reset would drop it."""
    scan = started()
    scan.moved(100)
    scan.machine.inhibit(INHIBIT)
    writes = len(scan.written)
    scan.blink()
    scan.run(0.5)
    now = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, replace(now, mode=Mode.WIDE, individual_scissor=False).registers)
    scan.blink()
    assert scan.state is State.WF_ACTIVATION
    scan.run(5.0)
    assert len(scan.written) == writes
    assert scan.state is State.RUNNING_IDLE


def test_once_it_is_permitted_an_activation_goes_on_as_the_link_is_back() -> None:
    scan = activating()
    scan.controller.lost(None, scan.now)
    scan.machine.inhibit(INHIBIT)
    scan.machine.permit("PLC")
    scan.come_back(0.05)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)


# -- a halt that is lost with the link ---------------------------------------------------------------------


@pytest.mark.parametrize("is_written", [False, True])
@pytest.mark.parametrize("trigger", [Trigger.ASK_HALT, Trigger.ASK_RESET])
def test_an_activation_whose_halt_was_lost_is_reset_once_the_link_is_back(
    trigger: Trigger, is_written: bool
) -> None:
    """Only a hold was kept for that, which ends no activation: 428 counts."""
    scan = activating()
    scan.controller.reset(trigger)
    if is_written:
        scan.forgets = 1
        scan.step(answer=False)
    else:
        scan.controller.lost(None, scan.now)
    scan.come_back(0.05)
    is_reset_at_once(scan)


def test_a_release_whose_halt_was_lost_is_reset_once_the_link_is_back() -> None:
    scan = releasing()
    scan.controller.reset(Trigger.ASK_HALT)
    scan.blink()
    assert scan.gripper.is_moving
    is_reset_at_once(scan)


def test_a_halt_that_was_lost_ends_no_activation_that_another_client_begins_later() -> None:
    scan = started()
    scan.move(200, speed=0)
    scan.run(0.5)
    scan.halt()
    scan.controller.lost(None, scan.now)
    for image in ([0], ACTIVATE):
        scan.gripper.write(0, image)
        scan.now += 1.0
    scan.come_back(0.05)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert scan.latest.activation_echo


def test_a_halt_that_was_lost_counts_at_the_next_link_alone() -> None:
    """If nothing drives the fingers by then, it is over."""
    scan = activating()
    scan.controller.reset(Trigger.ASK_HALT)
    scan.controller.lost(None, scan.now)
    scan.now += 60.0
    scan.come_back(0.05)
    assert scan.state is State.RUNNING_IDLE
    scan.blink()
    for image in ([0], ACTIVATE):
        scan.gripper.write(0, image)
        scan.now += 1.0
    scan.blink()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)


# -- a fault in an activation ----------------------------------------------------------------------------


@pytest.mark.parametrize("code", [0x08, 0x0C, Fault.ACTIVATION_FAULT, Fault.SCISSOR_BLOCKED])
@pytest.mark.parametrize("keep_grip", [False, True])
def test_a_stop_takes_back_an_activation_that_has_failed(code: int, keep_grip: bool) -> None:
    """It was forgotten as the fault showed, and went on as that cleared: 442 counts after SHUTDOWN."""
    scan = activating()
    scan.gripper.inject_fault(code, 3.0)
    scan.until(lambda: scan.state is State.FAULT, 1.0)
    assert scan.controller.is_driven
    scan.stop(keep_grip=keep_grip)
    before = scan.travels()
    scan.run(10.0)
    assert not scan.latest.activation_echo
    assert scan.travels() == before


def test_a_fault_after_an_activation_drives_nothing() -> None:
    """A halt need not reset then, which would drop a part."""
    scan = started()
    scan.moved(100, Finger.A)
    scan.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    scan.run(4 * POLL_S)
    assert scan.state is State.FAULT
    assert not scan.controller.is_driven
    scan.stop()
    assert scan.latest.activation_echo
