"""Simple control, individual control and the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Fault, Finger, Initialization, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench


def test_numbers_of_numpy_are_numbers() -> None:
    byte: Any = np.uint8(100)
    seconds: Any = np.float32(0.5)
    number: Any = np.int64(1)
    words: Any = np.array([1, 2], np.uint16)
    gripper = SimulatedGripper(
        lambda: 0.0,
        device_cycle=seconds,
        speedup=seconds,
        scissor_limit=(byte, byte),
        seed=number,
    )
    gripper.write(number, words)
    assert gripper.request_registers == (0, 1, 2, 0, 0, 0, 0, 0)
    assert {type(each) for each in gripper.request_registers} == {int}
    gripper.place_object(number, byte, soft=byte)
    gripper.inject_fault(Fault.ACTIVATION_FAULT, seconds)
    gripper.power_cycle(number)
    assert gripper.position(number) == gripper.position(Finger.A)


def test_simple_control_lets_a_drive_all_fingers_and_echoes_the_own_registers(active: Bench) -> None:
    """The trap: B and C stand at 200 and echo what nothing drives them to."""
    active.reach({Finger.A: 200, Finger.B: 30, Finger.C: 40, Finger.SCISSOR: 50})
    assert active.positions == (200, 200, 200, 137)
    assert [active.status.requested_position(axis) for axis in THREE_FINGER.axes] == [200, 30, 40, 50]


def test_simple_control_uses_speed_and_force_of_a(active: Bench) -> None:
    active.write(axes=(AxisRequest(0, 0, 0), AxisRequest(0, 255, 0), AxisRequest(0, 255, 0), AxisRequest()))
    active.go({Finger.A: 200}, speed=0)
    active.wait(5)
    assert len(set(active.positions[:3])) == 1
    assert active.gripper.is_moving


def test_raising_individual_control_under_go_hands_over_at_once(active: Bench) -> None:
    active.reach({Finger.A: 200, Finger.B: 30, Finger.C: 40, Finger.SCISSOR: 50})
    active.write(individual_fingers=True)
    assert active.gripper.is_moving
    active.settle()
    assert active.positions == (200, 30, 40, 137)
    active.write_and_settle(individual_scissor=True)
    assert active.positions == (200, 30, 40, 50)


def test_raising_individual_control_with_loaded_registers_moves_nothing(active: Bench) -> None:
    active.reach(200)
    active.write(axes=tuple(AxisRequest(active.gripper.position(axis)) for axis in THREE_FINGER.axes))
    before = [active.gripper.travel(axis) for axis in THREE_FINGER.axes]
    active.write(individual_fingers=True, individual_scissor=True)
    active.wait(5)
    assert [active.gripper.travel(axis) for axis in THREE_FINGER.axes] == before


@pytest.mark.parametrize(("mode", "scissor"), [(Mode.PINCH, 219), (Mode.WIDE, 24), (Mode.SCISSOR, 6)])
def test_mode_change_opens_first_and_returns(active: Bench, mode: Mode, scissor: int) -> None:
    active.reach(100)
    active.write(mode=mode)
    status = active.status
    assert status.initialization is Initialization.CHANGING_MODE
    assert status.fault is Fault.MODE_CHANGE_PENDING
    assert not status.is_moving
    active.wait(0.3)
    assert active.positions[0] < 100
    assert active.positions[3] == 137, "the scissor waits for the fingers"
    while active.status.initialization is Initialization.CHANGING_MODE:
        assert not (active.positions[0] > 6 and active.positions[3] != 137)
        active.wait(0.05)
    assert active.fault is Fault.NONE
    active.settle()
    if mode is not Mode.SCISSOR:
        assert active.positions == (100, 100, 100, scissor)


def test_mode_change_without_go_leaves_the_fingers_open(active: Bench) -> None:
    active.reach(100)
    active.write(go=False, mode=Mode.WIDE)
    assert active.fault is Fault.NONE
    active.settle()
    assert active.positions == (6, 6, 6, 24)
    assert active.words == (0x35, 0x00)


def test_the_limit_of_the_pinch_mode_ends_with_the_mode(active: Bench) -> None:
    active.write_and_settle(mode=Mode.PINCH)
    active.reach(120)
    assert active.positions == (113, 113, 113, 219)
    assert active.outcomes == (ObjectStatus.AT_POSITION,) * 4
    active.write_and_settle(individual_fingers=True)
    assert active.positions == (113, 113, 113, 219), "fingers of their own in the pinch mode"
    active.write(individual_scissor=True)
    assert active.outcomes == (ObjectStatus.IN_MOTION,) * 4
    active.settle()
    assert active.positions == (120, 120, 120, 120)


def test_another_mode_gives_the_fingers_their_stroke_back(active: Bench) -> None:
    active.write_and_settle(mode=Mode.PINCH)
    active.reach(255, mode=Mode.BASIC)
    assert active.positions == (241, 241, 241, 137)


def test_a_contact_outlasts_the_limit_of_the_pinch_mode(active: Bench) -> None:
    active.write_and_settle(mode=Mode.PINCH)
    active.gripper.place_object(Finger.B, 100)
    active.reach(120)
    active.write_and_settle(individual_fingers=True, individual_scissor=True)
    assert active.positions == (120, 100, 120, 120)
    assert active.outcomes[1] is ObjectStatus.CONTACT_CLOSING


def test_scissor_mode_grips_with_the_scissor_alone(active: Bench) -> None:
    active.write_and_settle(mode=Mode.SCISSOR)
    fingers = [active.gripper.travel(axis) for axis in THREE_FINGER.axes[:3]]
    active.close()
    assert active.positions == (6, 6, 6, 232)
    assert active.outcomes == (ObjectStatus.AT_POSITION,) * 4
    active.reach(0)
    assert active.positions == (6, 6, 6, 15)
    active.gripper.place_object(Finger.SCISSOR, 150)
    active.close()
    assert active.positions == (6, 6, 6, 150)
    assert active.outcomes[3] is ObjectStatus.CONTACT_CLOSING
    assert [active.gripper.travel(axis) for axis in THREE_FINGER.axes[:3]] == fingers


def test_scissor_mode_leaves_the_fingers_where_they_are_also_under_individual_control(active: Bench) -> None:
    """Individual control of the fingers, except in the scissor mode without that of the scissor (manual)."""
    active.write_and_settle(mode=Mode.SCISSOR)
    active.reach({Finger.A: 50, Finger.B: 100, Finger.C: 150}, individual_fingers=True)
    assert active.positions == (6, 6, 6, 50)
    active.write_and_settle(individual_scissor=True)
    assert active.positions[:3] == (50, 100, 150)


def test_the_mode_is_ignored_under_individual_scissor_control(individual: Bench) -> None:
    before = individual.positions
    individual.write(mode=Mode.PINCH)
    individual.wait(5)
    assert individual.positions == before
    assert individual.status.initialization is Initialization.COMPLETE
    assert individual.status.mode is Mode.PINCH


def test_another_mode_on_the_way_replaces_the_first(active: Bench) -> None:
    active.write(mode=Mode.PINCH)
    active.wait(0.1)
    active.write_and_settle(mode=Mode.WIDE)
    assert active.positions[3] == 24


def test_individual_scissor_control_abandons_a_mode_change(active: Bench) -> None:
    active.go(6)
    active.write(mode=Mode.PINCH)
    active.wait(0.1)
    assert active.positions[3] > 137
    active.go({Finger.SCISSOR: 50}, individual_scissor=True)
    assert active.status.initialization is Initialization.COMPLETE
    active.settle()
    assert active.positions[3] == 50


def test_a_mode_change_during_activation_follows_it(bench: Bench) -> None:
    bench.write(activate=True)
    bench.write_and_settle(mode=Mode.PINCH)
    assert bench.positions == (6, 6, 6, 219)
    assert bench.status.initialization is Initialization.COMPLETE
