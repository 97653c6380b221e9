"""Simple control, individual control and the modes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import numpy as np
import pytest

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Fault, Finger, Initialization, Mode
from robotiq_async.values.request import AxisRequest
from tests.simulator.stories import tell

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

STORIES = {
    # The trap: B and C stand at 200 and echo what nothing drives them to.
    "A drives all fingers, which echo their own registers": "active, reach A=200 B=30 C=40 S=50, "
    "at 200 200 200 137, echo 200 30 40 50",
    "raising individual control hands over at once": "active, reach A=200 B=30 C=40 S=50, write rICF=1, "
    "moves, settle, at 200 30 40 137, write rICS=1, settle, at 200 30 40 50",
    "with loaded registers it moves nothing": "active, reach 200, go A=200 B=200 C=200 S=137, note, "
    "write rICF=1 rICS=1, wait 5, still",
    "a mode without go leaves the fingers open": "active, reach 100, write rGTO=0 rMOD=2, fault 0, settle, "
    "at 6 6 6 24, words 35 00",
    # Also with fingers of their own in the pinch mode.
    "the limit of the pinch mode ends with the mode": "active, write rMOD=1, settle, reach 120, "
    "at 113 113 113 219, all arrived, write rICF=1, settle, at 113 113 113 219, write rICS=1, all moving, "
    "settle, at 120 120 120 120",
    "a contact outlasts that limit": "active, write rMOD=1, settle, place B 100, reach 120, "
    "write rICF=1 rICS=1, settle, at 120 100 120 120, B closing",
    "the scissor mode grips with the scissor alone": "active, write rMOD=3, settle, note, reach 255, "
    "at 6 6 6 232, all arrived, reach 0, at 6 6 6 15, still ABC",
    # Individual control of the fingers, except in the scissor mode without that of the scissor (manual).
    "so it does with individual fingers": "active, write rMOD=3, settle, reach A=50 B=100 C=150 rICF=1, "
    "at 6 6 6 50, write rICS=1, settle, at 50 100 150",
    "an individual scissor ignores the mode": "individual, note, write rMOD=1, wait 5, still, "
    "state complete, words FB FF",
    "another mode on the way replaces the first": "active, write rMOD=1, wait 0.1, write rMOD=2, settle, "
    "at 6 6 6 24",
    "an individual scissor abandons a change": "active, go 6, write rMOD=1, wait 0.1, state changing, "
    "go S=50 rICS=1, state complete, settle, at 6 6 6 50",
    "a change during an activation follows it": "on, write rACT=1, write rMOD=1, settle, at 6 6 6 219, "
    "state complete",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


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


def test_simple_control_uses_speed_and_force_of_a(active: Bench) -> None:
    active.write(axes=(AxisRequest(0, 0, 0), AxisRequest(0, 255, 0), AxisRequest(0, 255, 0), AxisRequest()))
    active.go({Finger.A: 200}, speed=0)
    active.wait(5)
    assert len(set(active.positions[:3])) == 1
    assert active.gripper.is_moving


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
