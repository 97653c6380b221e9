"""Axes that press again on a part: they show a motion for a moment, and a hold must not loosen the grip."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest

from robotiq_async import Fault, Finger, ObjectStatus
from robotiq_async.control.waiters import Move
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values import registers as reg
from robotiq_async.values.model import HAND_E, THREE_FINGER, TWO_FINGER_85, Model
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import Request
from tests.control.scan import Outcome, Scan

A, B, C = Finger.A, Finger.B, Finger.C
PART = 150
"""Reading of an axis that holds the part."""
GRIPPERS = [
    *(pytest.param(model, 0.005, id=model.name) for model in (TWO_FINGER_85, HAND_E)),
    *(pytest.param(THREE_FINGER, cycle, id=f"3f-{cycle:g}") for cycle in (0.0, 0.005, 0.1)),
]
"""Each model, and some device cycles."""


def holding(model: Model = THREE_FINGER, device_cycle: float = 0.005, *, lag: int = 0) -> Scan:
    """Finger A, or the jaw, holds a part."""
    scan = Scan(model=model, device_cycle=device_cycle, lag=lag)
    scan.start()
    scan.gripper.place_object(A, PART)
    assert scan.moved(255, A, speed=255).contacts == A
    scan.run(0.6)
    return scan


class Silent(SimulatedGripper):
    """It can be kept from reporting a contact."""

    reports_contacts = True

    def status_registers(self) -> Registers:
        block = list(super().status_registers())
        if not self.reports_contacts:
            reg.gDT[0].write(block, ObjectStatus.IN_MOTION)
        return tuple(block)


def closed_after_a_halt(scan: Scan) -> Move:
    scan.halted()
    return scan.move(255, A)[0]


def closed_with_more_force(scan: Scan) -> Move:
    return scan.move(255, A, force=255)[0]


def held(scan: Scan, _: Move) -> None:
    asked = scan.hold()
    scan.until(lambda: asked.is_answered, 1.0)


def cancelled(scan: Scan, move: Move) -> None:
    scan.controller.abandon(move, unseen=True)


def timed_out(scan: Scan, move: Move) -> None:
    scan.controller.abandon(move)


def minor_fault(scan: Scan, _: Move) -> None:
    scan.gripper.inject_fault(Fault(0x09), 0.1)


def kept_at_the_end(scan: Scan, _: Move) -> None:
    scan.stop(keep_grip=True)


@pytest.mark.parametrize(("model", "device_cycle"), GRIPPERS)
@pytest.mark.parametrize("ends", [held, cancelled, timed_out, minor_fault, kept_at_the_end])
@pytest.mark.parametrize("presses", [closed_after_a_halt, closed_with_more_force])
def test_a_grip_is_not_loosened_while_its_axis_presses_again(
    model: Model,
    device_cycle: float,
    presses: Callable[[Scan], Move],
    ends: Callable[[Scan, Move], None],
) -> None:
    """The motion that shows was held: 45 N became 3."""
    scan = holding(model, device_cycle)
    at, move = scan.latest.position(A), presses(scan)
    scan.until(lambda: A in scan.latest.moving)
    scan.step()
    assert scan.latest.position(A) == at
    ends(scan, move)
    scan.run(1.5)
    assert scan.last_image.position(A) == 255
    assert scan.gripper.grips == A


@pytest.mark.parametrize("presses", [closed_after_a_halt, closed_with_more_force])
@pytest.mark.parametrize("device_cycle", [0.03, 0.1, 0.2])
def test_a_grip_is_not_loosened_by_a_hold_that_comes_before_its_axis_presses_again(
    device_cycle: float, presses: Callable[[Scan], Move]
) -> None:
    scan = holding(device_cycle=device_cycle)
    presses(scan)
    scan.until(lambda: scan.last_image.go)
    held(scan, Move(0, A, scan.now, Outcome()))
    scan.run(1.5)
    assert scan.last_image.position(A) == 255
    assert scan.gripper.grips == A


def test_a_hold_of_several_axes_stops_those_that_move_at_once_and_waits_for_one_that_may_press() -> None:
    scan = holding()
    scan.halted()
    scan.move(255, A | B, speed=255)
    scan.until(lambda: scan.latest.moving == A | B)
    scan.run(0.02)
    at, asked = scan.latest.position(B), scan.hold()
    scan.step()
    assert scan.last_image.position(B) <= at + 3
    assert not asked.is_answered
    scan.until(lambda: asked.is_answered, 0.1)
    assert scan.latest.finger_status(A) is ObjectStatus.CONTACT_CLOSING
    scan.run(1.0)
    assert scan.positions()[B] <= at + 3
    assert scan.gripper.grips == A


@pytest.mark.parametrize("device_cycle", [0.005, 0.03])
def test_a_hold_stops_an_axis_whose_part_has_gone(device_cycle: float) -> None:
    """While it may press it goes on: the hold waits until it has moved off."""
    scan = holding(device_cycle=device_cycle)
    scan.halted()
    scan.gripper.remove_object(A)
    scan.move(255, A, speed=0)
    scan.until(lambda: A in scan.latest.moving)
    asked = scan.hold(A)
    scan.until(lambda: asked.is_answered, 1.0)
    scan.run(3.0)
    assert scan.positions()[A] <= PART + 4


@pytest.mark.parametrize("model", [THREE_FINGER, TWO_FINGER_85, HAND_E], ids=str)
def test_a_hold_long_after_our_last_write_stops_an_axis_whose_part_has_gone(model: Model) -> None:
    """Another client raised the force, which no echo shows: the hold was acknowledged, and dropped."""
    scan = Scan(model=model)
    scan.start()
    scan.gripper.place_object(A, PART)
    assert scan.moved(255, A, speed=0).contacts == A
    scan.run(0.6)
    scan.gripper.remove_object(A)
    image = Request.from_registers(scan.written[-1], model)
    theirs = replace(image, axes=tuple(replace(axis, force=255) for axis in image.axes))
    scan.gripper.write(0, theirs.registers)
    scan.until(lambda: A in scan.latest.moving)
    asked = scan.hold(A)
    scan.until(lambda: asked.is_answered, 1.0)
    scan.run(3.0)
    assert scan.positions()[A] <= PART + 12


def holding_silently() -> tuple[Scan, Silent]:
    """A finger that presses on a part, of a gripper that can be told to report no contact."""
    scan = Scan()
    scan.gripper = gripper = Silent(lambda: scan.now, spread=False)
    scan.start()
    gripper.place_object(A, PART)
    scan.moved(255, A)
    return scan, gripper


def test_holds_that_wait_are_timed_one_by_one() -> None:
    """One that has been dropped does not shorten the time of the next."""
    scan, gripper = holding_silently()
    scan.run(0.6)
    gripper.reports_contacts = False
    scan.run(0.1)
    for axes in (A, A, A | B):
        outcome = scan.hold(axes)
        scan.run(0.4)
        assert not outcome.is_answered
        scan.run(0.2)
        assert outcome.is_answered
        assert scan.last_image.position(A) == 255


def test_a_hold_does_not_wait_for_ever_for_an_axis_that_presses_and_reports_no_contact() -> None:
    scan, gripper = holding_silently()
    scan.halted()
    gripper.reports_contacts = False
    scan.move(255, A)
    scan.until(lambda: A in scan.latest.moving)
    asked = scan.hold(A)
    assert 0.4 < scan.until(lambda: asked.is_answered) < 0.6
    assert scan.last_image.position(A) == 255


def test_a_new_position_goes_before_a_hold_that_waits() -> None:
    scan = holding()
    scan.halted()
    scan.move(255, A)
    scan.until(lambda: A in scan.latest.moving)
    asked = scan.hold(A)
    scan.step()
    assert not asked.is_answered
    assert scan.moved(20, A).positions[A] == pytest.approx(20, abs=2)
    assert asked.answers == [None]


def test_a_grip_is_not_loosened_by_another_client_that_sets_rgto_again_just_before_a_hold() -> None:
    scan = holding()
    image = scan.written[-1]
    scan.gripper.write(0, (image[0] & ~0x0800, *image[1:]))
    scan.run(0.1)
    scan.gripper.write(0, image)
    scan.until(lambda: A in scan.latest.moving)
    held(scan, Move(0, A, scan.now, Outcome()))
    scan.run(1.0)
    assert scan.latest.requested_position(A) == 255
    assert scan.gripper.grips == A


def test_a_contact_outlives_a_lost_link_with_rgto_clear() -> None:
    scan = holding()
    scan.halted()
    scan.blink()
    scan.run(0.1)
    scan.move(255, A)
    scan.until(lambda: A in scan.latest.moving)
    held(scan, Move(0, A, scan.now, Outcome()))
    scan.run(1.0)
    assert scan.gripper.grips == A


def test_a_reset_ends_what_may_press(scan: Scan) -> None:
    """After it the fingers stand elsewhere: one that moves past the old place is held there at once."""
    scan.gripper.place_object(A, PART)
    scan.moved(255, A)
    scan.gripper.remove_object(A)
    scan.controller.reset()
    scan.run(0.5)
    scan.controller.activate()
    scan.run(0.1)
    scan.until(lambda: scan.latest.is_activated, poll=0.1)
    scan.run(0.6)
    scan.command(A, position=255, speed=0)
    scan.until(lambda: scan.latest.position(A) >= PART - 1)
    asked = scan.hold(A)
    scan.step()
    assert asked.is_answered


def test_an_axis_that_has_moved_off_and_comes_past_is_held_at_once() -> None:
    """It has shown nothing but motion since its contact, and shows it at that place."""
    scan = holding()
    scan.gripper.remove_object(A)
    scan.command(A, position=20, speed=255)
    scan.until(lambda: scan.latest.position(A) < PART - 20, poll=0.05)
    scan.command(A, position=255, speed=0)
    scan.until(lambda: scan.latest.position(A) == PART - 1)
    asked = scan.hold(A)
    scan.step()
    assert asked.is_answered
    assert scan.last_image.position(A) < PART + 5, "it is held, and does not press on"


@pytest.mark.parametrize(("model", "counts"), [(TWO_FINGER_85, 4), (HAND_E, 7), (THREE_FINGER, 2)], ids=str)
def test_an_axis_whose_pad_yields_to_more_force_is_not_held_where_it_is(model: Model, counts: int) -> None:
    """A body of a simulated Hand-E lost its part: 7 counts counted as moved off, and the hold let go."""
    scan = Scan(model=model)
    scan.start()
    scan.gripper.place_object(A, PART, soft=counts)
    scan.moved(255, A, speed=255, force=0)
    at = scan.latest.position(A)
    scan.run(0.6)
    scan.move(255, A, force=255)
    scan.until(lambda: A in scan.latest.moving and scan.latest.position(A) > at)
    held(scan, Move(0, A, scan.now, Outcome()))
    scan.run(1.0)
    assert scan.gripper.grips == A
    assert scan.latest.requested_position(A) == 255
