"""Distance, speed and end of motions."""

from __future__ import annotations

import math
from statistics import mean
from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.calibration.scales import closing_time
from robotiq_async.calibration.thesis import CLOSING_MS
from robotiq_async.values.enums import Finger, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from tests.simulator.conftest import CYCLE

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.simulator.conftest import Bench


def _measured() -> dict[int, float]:
    """Seconds of a full closing by speed value: thesis, table A1.1, mean of three runs."""
    return {value: mean(runs) / 1000 for value, runs in CLOSING_MS.items()}


MEASURED = _measured()


@pytest.mark.parametrize(("speed", "seconds"), MEASURED.items())
def test_full_closing_takes_as_long_as_measured(active: Bench, speed: int, seconds: float) -> None:
    """Within 1 % of it."""
    active.go(255, speed=speed)
    active.wait(0.99 * seconds)
    assert active.status.is_moving
    active.wait(0.02 * seconds)
    assert not active.status.is_moving
    assert active.gripper.position(Finger.A) >= 240


def test_closing_time_between_the_measured_values() -> None:
    assert closing_time(2) == pytest.approx((closing_time(0) + closing_time(4)) / 2)
    assert closing_time(253) == pytest.approx((2 * closing_time(252) + closing_time(255)) / 3)
    times = [closing_time(speed) for speed in range(256)]
    assert times == sorted(times, reverse=True)
    assert len(set(times)) == 256
    for speed in (-1, 256):
        with pytest.raises(ValueError, match=r"speed must be in 0\.\.255"):
            closing_time(speed)


@pytest.mark.parametrize(
    ("axis", "asked", "reading"),
    [
        *((Finger.A, asked, max(6, min(asked, 241))) for asked in (0, 6, 7, 100, 240, 241, 255)),
        *((Finger.SCISSOR, asked, max(15, min(asked, 232))) for asked in (0, 11, 24, 232, 255)),
    ],
)
def test_readings(individual: Bench, axis: Finger, asked: int, reading: int) -> None:
    individual.reach(100 if asked < 100 else 50)
    individual.reach({axis: asked})
    status = individual.status
    assert status.position(axis) == reading
    assert status.requested_position(axis) == asked
    assert status.finger_status(axis) is ObjectStatus.AT_POSITION


def test_a_limit_replaces_the_request_and_the_echo_keeps_it(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(scissor_limit=(100, 150))
    bench.activate_individually()
    bench.reach({Finger.SCISSOR: 220})
    assert bench.gripper.target(Finger.SCISSOR) == 150
    assert bench.status.position(Finger.SCISSOR) == 150
    assert bench.status.requested_position(Finger.SCISSOR) == 220
    assert bench.status.finger_status(Finger.SCISSOR) is ObjectStatus.AT_POSITION


def test_a_new_target_on_the_way_turns_the_finger_round(individual: Bench) -> None:
    individual.go({Finger.A: 255})
    individual.wait(1)
    turned_at = individual.gripper.position(Finger.A)
    individual.reach({Finger.A: 6})
    assert individual.gripper.position(Finger.A) == 6
    assert individual.gripper.travel(Finger.A) > 2 * (turned_at - 6)


def test_a_new_speed_on_the_way_counts_from_there(individual: Bench) -> None:
    began = individual.now
    individual.go({Finger.A: 241}, speed=0)
    individual.wait(2)
    way_left = 241 - individual.gripper.position(Finger.A)
    individual.reach({Finger.A: 241}, speed=255)
    expected = 2 + way_left / THREE_FINGER.stroke.counts * closing_time(255)
    assert individual.now - began == pytest.approx(expected, abs=0.1)


def test_halt_stops_where_the_finger_is_and_going_again_resumes(active: Bench) -> None:
    active.go(255)
    active.wait(1)
    active.write(go=False)
    stopped_at = active.positions
    assert 7 < stopped_at[0] < 240
    active.wait(10)
    assert active.positions == stopped_at
    assert not active.gripper.is_moving
    assert not active.status.is_moving
    assert active.gripper.target(Finger.A) == stopped_at[0]
    active.write_and_settle(go=True)
    assert active.positions[:3] == (241, 241, 241)


def test_speedup(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(speedup=10.0, device_cycle=0)
    bench.write_and_settle(activate=True)
    began = bench.now
    bench.go(255, speed=128)
    while bench.gripper.is_moving:
        bench.wait(0.001)
    assert bench.now - began == pytest.approx(closing_time(128) / 10, abs=0.002)


def test_a_longer_device_cycle_holds_for_the_writes_after_it(individual: Bench) -> None:
    individual.gripper.write(0, individual.request.registers)
    individual.gripper.device_cycle = 0.5
    individual.wait(CYCLE * 1.001)
    individual.go({Finger.A: 200})
    individual.wait(0.49)
    assert not individual.gripper.is_moving
    individual.wait(0.01)
    assert individual.gripper.is_moving


def test_a_shorter_device_cycle_keeps_the_order_of_writes(make_bench: Callable[..., Bench]) -> None:
    changed, patient = make_bench(), make_bench()
    for bench in (changed, patient):
        bench.activate_individually()
        bench.gripper.device_cycle = 1.0
    travelled = changed.gripper.travel(Finger.A)
    changed.go({Finger.A: 200})
    changed.gripper.device_cycle = 0
    changed.go({Finger.A: 100})
    patient.go({Finger.A: 200})
    patient.go({Finger.A: 100})
    for bench in (changed, patient):
        assert not bench.gripper.is_moving
        bench.wait(1)
    assert changed.gripper.target(Finger.A) == 100
    assert changed.gripper.position(Finger.A) == patient.gripper.position(Finger.A) < 20
    changed.settle()
    assert changed.gripper.position(Finger.A) == 100
    assert changed.gripper.travel(Finger.A) - travelled == 94, "the first of the two was never ahead"
    changed.go({Finger.A: 50})
    assert changed.gripper.is_moving, "from then on writes take effect at once"


@pytest.mark.parametrize(("value", "error"), [(-0.1, ValueError), (math.nan, ValueError), ("1", TypeError)])
def test_a_device_cycle_that_is_none_changes_nothing(
    bench: Bench, value: Any, error: type[Exception]
) -> None:
    with pytest.raises(error, match="device_cycle must be seconds"):
        bench.gripper.device_cycle = value
    assert bench.gripper.device_cycle == CYCLE
