"""Activation, reset, device cycle, partial writes and power."""

from __future__ import annotations

from typing import TYPE_CHECKING

import pytest

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Fault, Finger, Initialization
from robotiq_async.values.request import Request

if TYPE_CHECKING:
    from collections.abc import Callable

    from tests.simulator.conftest import Bench


def test_activation_closes_and_opens_the_fingers(bench: Bench) -> None:
    began = bench.now
    bench.write(activate=True)
    assert bench.status.initialization is Initialization.ACTIVATING
    assert bench.status.activation_echo
    assert not bench.status.is_moving
    assert bench.gripper.is_moving
    bench.settle()
    assert bench.status.initialization is Initialization.COMPLETE
    assert bench.gripper.travel(Finger.A) == 2 * 235
    assert bench.positions == (6, 6, 6, 137)
    assert 2 < bench.now - began < 20


def test_a_gripper_that_has_lost_its_activation_and_keeps_ract(active: Bench) -> None:
    active.reach(100)
    active.gripper.strand()
    assert active.words == (0x01, 0x00)
    assert active.fault is Fault.NONE
    assert active.gripper.request_registers[0] == 0x0100
    active.go(200)
    active.wait(5)
    assert not active.gripper.is_moving, "only a rising rACT activates"
    active.write(activate=False, go=False)
    assert active.words == (0x00, 0x00)
    active.activate()


def test_a_gripper_is_stranded_in_the_middle_of_an_activation(bench: Bench) -> None:
    bench.write(activate=True)
    bench.wait(1)
    bench.gripper.strand()
    travel = bench.gripper.travel(Finger.A)
    bench.wait(5)
    assert bench.gripper.travel(Finger.A) == travel


def test_without_power_nothing_is_stranded(bench: Bench) -> None:
    bench.gripper.power_off()
    bench.gripper.strand()
    bench.gripper.power_on()
    assert bench.words == (0, 0)


def test_failed_activation(bench: Bench) -> None:
    bench.gripper.fail_activation = True
    bench.write_and_settle(activate=True)
    assert bench.fault is Fault.ACTIVATION_FAULT
    assert bench.status.initialization is Initialization.ACTIVATING
    bench.go(255)
    bench.wait(5)
    assert not bench.gripper.is_moving
    assert bench.fault is Fault.ACTIVATION_FAULT
    bench.write(activate=False, go=False)
    assert bench.fault is Fault.NONE
    assert not bench.gripper.fail_activation
    bench.activate()


def test_a_request_during_activation_waits_for_it(bench: Bench) -> None:
    bench.write(activate=True)
    bench.go(200)
    assert bench.fault is Fault.ACTIVATION_PENDING
    assert bench.words == (0x19, 0x00)
    bench.settle()
    assert bench.fault is Fault.NONE
    assert bench.positions[:3] == (200, 200, 200)


def test_a_go_without_activation(bench: Bench) -> None:
    bench.go(255)
    bench.wait(5)
    assert bench.fault is Fault.NOT_ACTIVATED
    assert bench.positions == (6, 6, 6, 137)
    bench.write(go=False)
    assert bench.fault is Fault.NONE


@pytest.mark.parametrize("activating", [False, True])
def test_reset_stops_at_once_and_clears(bench: Bench, activating: bool) -> None:
    bench.write(activate=True)
    if not activating:
        bench.settle()
        bench.go(255)
    bench.wait(1)
    bench.write(activate=False, go=False)
    stopped_at = bench.positions
    assert bench.words == (0, 0)
    bench.wait(5)
    assert bench.positions == stopped_at
    assert not bench.gripper.is_moving


def test_rewriting_the_image_changes_nothing(active: Bench) -> None:
    active.gripper.place_object(Finger.B, 100)
    active.close()
    before = active.gripper.status_registers()
    for _ in range(5):
        active.write()
        active.wait(1)
    assert active.gripper.status_registers() == before


# Device cycle and partial writes.


def test_a_write_takes_effect_one_cycle_later(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(device_cycle=0.25)
    image = Request(activate=True, individual_fingers=False, individual_scissor=False).registers
    bench.gripper.write(0, image)
    assert bench.gripper.request_registers == image
    assert bench.gripper.status_registers()[0] == 0
    bench.wait(0.249)
    assert bench.gripper.status_registers()[0] == 0
    bench.wait(0.001)
    assert bench.gripper.status_registers()[0] == 0x1100


def test_writes_within_one_cycle_take_effect_one_after_the_other(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(device_cycle=1.0)
    echoes = []
    for position in (10, 20, 30):
        bench.gripper.write(1, [position])
        bench.wait(0.25)
    for _ in range(6):
        echoes.append(bench.status.requested_position(Finger.A))
        bench.wait(0.125)
    assert echoes == [0, 0, 10, 10, 20, 20]


def test_without_a_device_cycle_a_write_takes_effect_at_once() -> None:
    gripper = SimulatedGripper(lambda: 0.0, device_cycle=0)
    gripper.write(0, [0x0100])
    assert gripper.status_registers()[0] == 0x1100


def test_writes_are_recorded_with_their_time(bench: Bench) -> None:
    bench.gripper.write(0, [0x0100])
    bench.wait(1)
    bench.gripper.write(1, [0x00FF])
    assert bench.gripper.writes == (
        (1000.0, (0x0100, 0, 0, 0, 0, 0, 0, 0)),
        (1001.0, (0x0100, 0x00FF, 0, 0, 0, 0, 0, 0)),
    )


@pytest.mark.parametrize(
    ("offset", "registers", "error", "message"),
    [
        (-1, [0], ValueError, "address_offset"),
        (8, [0], ValueError, "address_offset"),
        (1, [0] * 8, ValueError, r"expected 1\.\.7"),
        (0, [], ValueError, "expected 1"),
        (0, [0x10000], ValueError, "registers"),
        (0, [1.0], TypeError, "registers"),
    ],
)
def test_bad_writes_change_nothing(
    bench: Bench, offset: int, registers: list[int], error: type[Exception], message: str
) -> None:
    with pytest.raises(error, match=message):
        bench.gripper.write(offset, registers)
    assert bench.gripper.request_registers == (0,) * 8
    assert bench.gripper.writes == ()


# Power.


def test_power_cycle_loses_everything_but_the_position(individual: Bench) -> None:
    individual.go(255)
    individual.wait(0.5)
    individual.gripper.write(0, [0x0100])
    stopped_at = individual.positions
    individual.gripper.power_cycle()
    individual.wait(5)
    assert individual.positions == stopped_at
    assert individual.words == (0, 0)
    assert individual.gripper.request_registers == (0,) * 8
    individual.write(activate=True)
    assert individual.status.initialization is Initialization.ACTIVATING


def test_writes_without_power_are_lost(active: Bench) -> None:
    active.gripper.power_cycle(off_time=2.0)
    assert not active.gripper.is_powered
    assert active.gripper.status_registers() == (0,) * 8
    active.write(activate=True)
    assert active.gripper.request_registers == (0,) * 8
    active.wait(2)
    assert active.gripper.is_powered
    assert active.words == (0, 0)


def test_power_cycle_clears_faults(active: Bench) -> None:
    for _ in range(2):  # active, then reset
        active.gripper.inject_fault(Fault.ACTIVATION_FAULT)
        active.gripper.power_cycle()
        assert active.fault is Fault.NONE


def test_a_gripper_that_is_not_switched_on(make_bench: Callable[..., Bench]) -> None:
    bench = make_bench(powered=False)
    bench.wait(1e6)
    assert not bench.gripper.is_powered
    bench.gripper.power_on()
    bench.activate()


@pytest.mark.parametrize(
    ("options", "error"),
    [
        ({"device_cycle": -0.1}, ValueError),
        ({"device_cycle": "1"}, TypeError),
        ({"speedup": 0}, ValueError),
        ({"speedup": float("inf")}, ValueError),
        ({"scissor_limit": (0, 100)}, ValueError),
        ({"scissor_limit": (100, 99)}, ValueError),
        ({"seed": -1}, ValueError),
        ({"seed": "1"}, TypeError),
    ],
)
def test_bad_options(
    make_bench: Callable[..., Bench], options: dict[str, object], error: type[Exception]
) -> None:
    with pytest.raises(error, match=next(iter(options))):
        make_bench(**options)


def test_inspection_takes_one_axis(bench: Bench) -> None:
    for ask in (bench.gripper.position, bench.gripper.target, bench.gripper.travel):
        with pytest.raises(ValueError, match="finger"):
            ask(Finger.ABC)
