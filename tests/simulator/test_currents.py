"""Currents of the motors: the manual's frames, and the thesis's peak."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.values.enums import Finger
from robotiq_async.values.model import THREE_FINGER
from tests.simulator.conftest import CYCLE

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench


def current(bench: Bench, axis: Finger) -> int:
    """The current of one axis, in counts."""
    counts = bench.status.current(axis)
    assert counts is not None
    return counts


def currents(bench: Bench) -> list[int]:
    """The currents of all axes, in counts."""
    return [current(bench, axis) for axis in THREE_FINGER.axes]


def course(bench: Bench, axis: Finger) -> list[int]:
    """The current of an axis in every device cycle, until nothing moves."""
    seen = []
    while bench.gripper.is_moving:
        seen.append(current(bench, axis))
        bench.wait(CYCLE)
    return seen


def test_at_full_speed_they_are_the_manuals(active: Bench) -> None:
    assert currents(active) == [0, 0, 0, 0]
    active.go(255, speed=255)
    assert currents(active) == [0x0F, 0x10, 0x0F, 0]
    active.settle()
    assert currents(active) == [0, 0, 0, 0]
    active.go(0, speed=255)
    assert currents(active) == [0x0B, 0x0E, 0x0B, 0]
    active.settle()
    assert currents(active) == [0, 0, 0, 0]


def test_a_slower_motion_draws_less(individual: Bench) -> None:
    drawn = []
    for speed in (0, 128, 255):
        individual.go({Finger.A: 255}, speed=speed)
        drawn.append(current(individual, Finger.A))
    assert 0 < drawn[0] < drawn[1] < drawn[2]


@pytest.mark.parametrize("force", [0, 128, 255])
@pytest.mark.parametrize("soft", [0, 40])
def test_axes_that_hold_draw_no_current(active: Bench, force: int, soft: int) -> None:
    active.gripper.place_object(Finger.ABC, 150, soft=soft)
    active.close(force=force)
    assert active.words == (0xB9, 0xEA)
    assert currents(active) == [0, 0, 0, 0]
    active.write(go=False)
    assert currents(active) == [0, 0, 0, 0]


def test_the_peak_of_a_contact_grows_with_the_force(active: Bench) -> None:
    active.gripper.place_object(Finger.ABC, 150)
    peaks = []
    for force in (0, 64, 128, 255):
        active.reach(0)
        active.go(255, force=force)
        peaks.append(max(course(active, Finger.A)))
    assert peaks == sorted(set(peaks))
    assert peaks[0] > 0x10, "no motion at full speed stops itself"
    assert 3 * peaks[-1] * 10 <= 1500, "the gripper's supply, in mA (manual)"


def test_on_something_rigid_the_peak_is_there_at_once_in_foam_it_takes_time(active: Bench) -> None:
    risen = {}
    for soft in (0, 40):
        active.gripper.place_object(Finger.ABC, 150, soft=soft)
        active.reach(0)
        active.go(255, force=255)
        seen = course(active, Finger.A)
        above = [current for current in seen if current > 0x0F]
        assert above == sorted(above)
        assert above[-1] == max(seen)
        risen[soft] = len({*above})
    assert risen[0] == 1
    assert risen[40] > 10


def test_a_stop_that_is_no_contact_has_no_peak(active: Bench) -> None:
    active.go(255, speed=255, force=255)
    assert {*course(active, Finger.A)} == {0x0F}


def test_an_axis_that_is_stopped_draws_nothing(active: Bench) -> None:
    active.go(255)
    active.wait(0.5)
    active.gripper.inject_fault(0x09)
    assert currents(active) == [0, 0, 0, 0]
