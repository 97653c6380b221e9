"""The spread of a gripper: on by default, off on request, the same for the same seed."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Finger, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.simulator.conftest import Bench

SEEDS = range(20)
FINGERS = THREE_FINGER.axes[:3]


@pytest.fixture
def real(make_bench: Callable[..., Bench]) -> Bench:
    """The default gripper, active, its axes on their own registers."""
    bench = make_bench(spread=True)
    bench.activate_individually()
    return bench


def one_of(make_bench: Callable[..., Bench], seed: int) -> Bench:
    bench = make_bench(spread=True, seed=seed)
    bench.activate()
    return bench


def test_it_is_on_by_default() -> None:
    assert [SimulatedGripper().position(finger) for finger in FINGERS] == [7, 6, 6], "as the manual prints"
    assert [SimulatedGripper(spread=False).position(finger) for finger in FINGERS] == [6, 6, 6]


def test_open_and_closed_read_what_real_ones_read(make_bench: Callable[..., Bench]) -> None:
    opened, closed = set(), set()
    for seed in SEEDS:
        bench = one_of(make_bench, seed)
        opened |= {*bench.positions[:3]}
        bench.close()
        closed |= {*bench.positions[:3]}
    assert opened == {6, 7}
    assert closed == {240, 241, 242}


@pytest.mark.parametrize("axis", THREE_FINGER.axes)
def test_a_real_axis_may_rest_beside_its_target(real: Bench, axis: Finger) -> None:
    """It reached 112 for 111 and 210 for 208 (TAMS): past it, by up to two (manual); some it meets."""
    beside = set()
    for position in (111, 208, 60, *range(100, 200, 10), *range(105, 45, -10)):
        way = 1 if position > real.gripper.position(axis) else -1
        real.reach({axis: position})
        assert real.status.finger_status(axis) is ObjectStatus.AT_POSITION
        beside.add(way * (real.gripper.position(axis) - position))
    assert beside == {0, 1, 2}


def test_a_seed_repeats_a_run_exactly(make_bench: Callable[..., Bench]) -> None:
    ends = []
    for seed in (4, 4, 5):
        bench = one_of(make_bench, seed)
        bench.gripper.place_object(Finger.B, 90)
        for position in (120, 0, 120):
            bench.reach(position)
            ends.append(bench.positions)
    assert ends[0] == ends[2] == ends[3] == ends[5]
    assert ends[:3] == ends[3:6] != ends[6:]


def test_an_axis_asked_to_stay_does_not_creep(real: Bench) -> None:
    """A hand requests axes that it does not address to stay at their reading; it must not make them creep."""
    real.reach(111)
    before = [real.gripper.travel(axis) for axis in THREE_FINGER.axes]
    for _ in range(3):
        real.go({axis: real.gripper.position(axis) for axis in THREE_FINGER.axes})
        real.write(go=False)
        real.go(111)
        real.write(go=False)
    assert [real.gripper.travel(axis) for axis in THREE_FINGER.axes] == before
    assert set(real.outcomes) == {ObjectStatus.AT_POSITION}


def test_a_finger_follows_requests_that_come_step_by_step(real: Bench) -> None:
    real.reach(20)
    for step in range(200):
        real.go({Finger.A: 20 + step // 2})
        assert real.gripper.position(Finger.A) == pytest.approx(20 + step / 2, abs=3)


def test_an_object_where_a_finger_stands_is_felt_there(real: Bench) -> None:
    for position in range(40, 200, 10):
        real.reach(position)
        here = real.positions[:3]
        real.gripper.place_object(Finger.ABC, position)
        real.close()
        assert all(abs(felt - stood) <= 3 for felt, stood in zip(real.positions[:3], here, strict=True))
        assert real.words == (0xB9, 0xEA | 0xC0)
        real.gripper.remove_object()


def test_near_its_stop_a_finger_still_goes_there(real: Bench) -> None:
    real.reach(8)
    real.reach(0)
    assert real.positions[:3] == (7, 6, 6)


def test_fingers_feel_the_same_object_some_counts_apart(make_bench: Callable[..., Bench]) -> None:
    felt = set()
    for seed in SEEDS:
        bench = one_of(make_bench, seed)
        bench.gripper.place_object(Finger.ABC, 190)
        bench.close()
        assert bench.words == (0xB9, 0xEA)
        felt |= {position - 190 for position in bench.positions[:3]}
    assert felt == {-2, -1, 0, 1, 2, 3}


@pytest.mark.parametrize("mode", Mode)
def test_the_scissor_reads_what_belongs_to_its_mode(make_bench: Callable[..., Bench], mode: Mode) -> None:
    for seed in SEEDS:
        bench = make_bench(spread=True, seed=seed)
        bench.activate(mode=mode)
        assert bench.positions[3] == {0: 137, 1: 219, 2: 24, 3: 15}[mode]
        assert bench.status.mode is mode
