"""Habits of grippers: what the manual leaves open, and what others saw them do beside it."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.simulator import Habits
from robotiq_async.values.enums import Fault, Finger, Initialization, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

MOVING, ARRIVED = ObjectStatus.IN_MOTION, ObjectStatus.AT_POSITION


def seconds_of_activation(bench: Bench, **changes: Any) -> float:
    """Seconds of an activation, by gIMC."""
    began = bench.now
    bench.write(activate=True, **changes)
    while bench.status.initialization is Initialization.ACTIVATING:
        bench.wait(0.01)
        assert bench.now < began + 100
    return bench.now - began


# How long an activation takes.


@pytest.mark.parametrize("seconds", [5.0, 12.0, 25.0])
@pytest.mark.parametrize("mode", Mode)
def test_an_activation_takes_as_long_in_every_mode(bench: Bench, seconds: float, mode: Mode) -> None:
    bench.gripper.habits = Habits(activation_time=seconds)
    assert seconds_of_activation(bench, mode=mode) == pytest.approx(seconds, abs=0.03)


def test_it_is_never_faster_than_the_fingers_and_as_slow_when_they_are_closed(bench: Bench) -> None:
    bench.gripper.habits = Habits(activation_time=0.0)
    assert seconds_of_activation(bench) == pytest.approx(4.2, abs=0.1)
    assert bench.gripper.travel(Finger.A) == 2 * 235
    bench.close()
    bench.gripper.habits = Habits(activation_time=12.0)
    bench.write(activate=False, go=False)
    assert seconds_of_activation(bench) == pytest.approx(12, abs=0.03)


# Object status behind the echo.


@pytest.fixture
def late(individual: Bench) -> Bench:
    """A gripper whose object status is 40 ms late; its fingers stand at their requests."""
    individual.gripper.habits = Habits(status_lag=0.04)
    individual.wait(1)
    assert individual.outcomes == (ARRIVED,) * 4
    return individual


def test_the_echo_comes_before_the_object_status(late: Bench) -> None:
    late.go({Finger.A: 200})
    asked = late.now
    while late.now < asked + 0.03:
        assert late.status.requested_position(Finger.A) == 200
        assert late.outcomes == (ARRIVED,) * 4
        assert late.status.registers[0] >> 14 == 3, "gSTA is as late"
        late.wait(0.005)
    late.wait(0.02)
    assert late.outcomes[0] is MOVING
    assert late.status.registers[0] >> 14 == 0
    assert late.gripper.position(Finger.A) > 6, "it has moved all the time"


def test_the_end_of_a_motion_is_seen_as_late(late: Bench) -> None:
    late.go({Finger.A: 100})
    while late.gripper.is_moving:
        late.wait(0.001)
    assert late.status.position(Finger.A) == 100
    assert late.outcomes[0] is MOVING
    late.wait(0.038)
    assert late.outcomes[0] is MOVING
    late.wait(0.003)
    assert late.outcomes[0] is ARRIVED


def test_a_motion_that_is_shorter_than_the_lag_is_seen_for_its_time(late: Bench) -> None:
    late.go({Finger.A: 9})
    late.wait(0.03)
    assert not late.gripper.is_moving
    seen = []
    for _ in range(20):
        seen.append(late.outcomes[0])
        late.wait(0.005)
    assert [state for state, _ in groupby(seen)] == [ARRIVED, MOVING, ARRIVED]


def test_a_reset_shows_at_once(late: Bench) -> None:
    late.write(activate=False, go=False)
    assert late.words == (0, 0)


# The fault of silence.


def test_the_first_status_after_a_second_shows_a_fault_once(active: Bench) -> None:
    active.gripper.habits = Habits(silence_fault=1.0)
    assert active.fault is Fault.NONE
    active.wait(0.99)
    assert active.fault is Fault.NONE
    active.wait(1.0)
    assert [active.fault for _ in range(3)] == [Fault.COMMUNICATION_NOT_READY, Fault.NONE, Fault.NONE]


def test_a_write_takes_it_away_and_nothing_stops(active: Bench) -> None:
    active.gripper.habits = Habits(silence_fault=1.0)
    active.go(255, speed=0)
    active.wait(5)
    active.write()
    assert active.fault is Fault.NONE
    active.wait(2)
    assert active.gripper.is_moving
    assert active.fault is Fault.COMMUNICATION_NOT_READY
    active.settle()
    assert active.positions[:3] == (241, 241, 241)


def test_a_serious_fault_is_shown_in_its_place(bench: Bench) -> None:
    bench.gripper.habits = Habits(silence_fault=1.0)
    bench.wait(1)
    assert [bench.fault, bench.fault] == [Fault.COMMUNICATION_NOT_READY, Fault.NONE]
    bench.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    bench.wait(5)
    assert bench.fault is Fault.SCISSOR_BLOCKED


# Writes that come too soon.


def test_writes_too_close_together_are_forgotten(active: Bench) -> None:
    active.gripper.habits = Habits(write_spacing=0.01)
    active.wait(1)
    before = len(active.gripper.writes)
    for number in range(10):
        active.gripper.write(1, [number])
        active.wait(0.005)
    kept = [write.registers[1] for write in active.gripper.writes[before:]]
    assert kept == [0, 2, 4, 6, 8], "they keep their distance from the last one that was kept"
    assert active.gripper.request_registers[1] == 8
    active.wait(1)
    assert active.status.requested_position(Finger.A) == 8


def test_writes_at_their_distance_are_kept(active: Bench) -> None:
    active.gripper.habits = Habits(write_spacing=0.01)
    for number in range(100):
        active.wait(0.01)
        active.gripper.write(1, [number])
        assert active.gripper.request_registers[1] == number


# Limits.


def test_a_limit_is_echoed_in_place_of_the_request(individual: Bench) -> None:
    individual.gripper.habits = Habits(echoes_limits=True)
    for asked, shown in ((255, 232), (100, 100), (0, 15)):
        individual.reach({Finger.SCISSOR: asked})
        assert individual.status.requested_position(Finger.SCISSOR) == shown
        assert individual.status.position(Finger.SCISSOR) == shown
        assert individual.outcomes[3] is ARRIVED
        individual.write(go=False)
        assert individual.status.requested_position(Finger.SCISSOR) == shown


def test_a_stop_is_echoed_as_asked_and_not_as_a_limit(individual: Bench) -> None:
    individual.gripper.habits = Habits(echoes_limits=True)
    individual.close()
    assert [individual.status.requested_position(axis) for axis in THREE_FINGER.axes] == [255, 255, 255, 232]
    individual.write(activate=False, go=False)
    assert individual.status.requested_position(Finger.SCISSOR) == 255, "no request is looked at while reset"


def test_the_limit_of_the_pinch_mode_is_one(bench: Bench) -> None:
    bench.gripper.habits = Habits(echoes_limits=True)
    bench.activate(mode=Mode.PINCH)
    bench.close()
    assert bench.positions == (113, 113, 113, 219)
    echoes = [bench.status.requested_position(axis) for axis in THREE_FINGER.axes]
    assert echoes == [113, 113, 113, 255], "the register of the scissor is not used"


# An emergency stop.


def test_an_emergency_stop_stops_and_sticks(active: Bench) -> None:
    active.go(255)
    active.wait(1)
    active.gripper.emergency_stop()
    assert not active.gripper.is_moving
    assert active.words == (0x19, 0x00)
    assert active.fault is Fault.ACTIVATION_PENDING
    active.gripper.end_emergency_stop()
    active.wait(100)
    assert active.words == (0x19, 0x00), "it does not come back by itself"
    assert active.fault is Fault.ACTIVATION_PENDING


@pytest.mark.parametrize("resets", [1, 2, 9])
def test_after_it_some_resets_are_needed(active: Bench, resets: int) -> None:
    active.gripper.emergency_stop(resets)
    active.gripper.end_emergency_stop()
    for _ in range(resets):
        active.write(activate=True)
        active.wait(60)
        assert active.fault is Fault.ACTIVATION_PENDING
        assert active.status.initialization is Initialization.ACTIVATING
        assert not active.gripper.is_moving
        active.write(activate=False)
        assert active.fault is Fault.NONE
        assert active.status.is_reset
    active.activate()
    assert active.fault is Fault.NONE


def test_before_its_end_no_reset_helps(active: Bench) -> None:
    active.gripper.emergency_stop()
    for _ in range(3):
        active.write(activate=False)
        active.write(activate=True)
        active.wait(60)
        assert active.fault is Fault.ACTIVATION_PENDING
    active.gripper.end_emergency_stop()
    active.write(activate=False)
    active.activate()


@pytest.mark.parametrize("pressed", [False, True])
def test_power_that_was_off_is_as_good_as_resets(active: Bench, pressed: bool) -> None:
    active.gripper.emergency_stop(9)
    if not pressed:
        active.gripper.end_emergency_stop()
    active.gripper.power_cycle()
    active.gripper.end_emergency_stop()
    active.activate()


def test_power_that_was_off_does_not_unlock_the_emergency_stop(active: Bench) -> None:
    active.gripper.emergency_stop()
    active.gripper.power_cycle()
    active.write(activate=False)
    active.write(activate=True)
    active.wait(60)
    assert active.fault is Fault.ACTIVATION_PENDING


def test_in_an_emergency_stop_a_release_does_not_move(active: Bench) -> None:
    active.close()
    active.gripper.emergency_stop()
    active.write(release=True)
    active.wait(60)
    assert active.positions[:3] == (241, 241, 241)


# Asleep.


def test_the_image_that_wakes_it_moves_nothing(individual: Bench) -> None:
    individual.gripper.is_asleep = True
    individual.go({Finger.A: 200})
    individual.wait(5)
    assert individual.status.requested_position(Finger.A) == 200, "it is echoed"
    assert individual.gripper.position(Finger.A) == 6
    assert not individual.gripper.is_asleep
    individual.write_and_settle()
    assert individual.gripper.position(Finger.A) == 200, "the same image once more"


@pytest.mark.parametrize("changes", [{}, {"go": False}], ids=["the same", "no rGTO"])
def test_any_image_with_ract_wakes_it(individual: Bench, changes: dict[str, bool]) -> None:
    individual.gripper.is_asleep = True
    individual.write(**changes)
    assert not individual.gripper.is_asleep
    individual.reach({Finger.A: 200})
    assert individual.gripper.position(Finger.A) == 200


def test_a_motion_goes_on_while_asleep_and_can_be_stopped(individual: Bench) -> None:
    individual.go({Finger.A: 200})
    individual.gripper.is_asleep = True
    individual.wait(0.2)
    assert individual.gripper.is_moving
    individual.go({Finger.A: 0})
    individual.wait(0.2)
    assert individual.gripper.target(Finger.A) == 200, "the new request is ignored, not the old one"
    individual.gripper.is_asleep = True
    individual.write(go=False)
    assert not individual.gripper.is_moving


def test_an_activation_and_a_reset_are_not_ignored(bench: Bench) -> None:
    bench.gripper.is_asleep = True
    bench.activate()
    bench.gripper.is_asleep = True
    bench.write(activate=False)
    assert bench.status.is_reset
    assert bench.gripper.is_asleep


# What no source settles.


def test_with_no_go_there_may_be_no_object_status(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 100)
    individual.reach({Finger.A: 200})
    individual.write(go=False)
    assert individual.words == (0x71, 0xFE)
    individual.write_and_settle(go=True)
    individual.gripper.habits = Habits(keeps_status_on_halt=False)
    individual.write(go=False)
    assert individual.words == (0x31, 0x00)


@pytest.mark.parametrize("go", [False, True])
def test_clearing_rics_may_open_the_fingers_or_not(individual: Bench, go: bool) -> None:
    individual.close()
    travelled = individual.gripper.travel(Finger.A)
    individual.gripper.habits = Habits(opens_without_rics=False)
    individual.write_and_settle(individual_scissor=False, mode=Mode.BASIC, go=go)
    assert individual.gripper.travel(Finger.A) == travelled
    assert individual.positions == (241, 241, 241, 137 if go else 232)
    individual.write(individual_scissor=True)
    individual.gripper.habits = Habits()
    individual.write(individual_scissor=False)
    assert individual.status.initialization is Initialization.CHANGING_MODE
    individual.settle()
    assert individual.gripper.travel(Finger.A) >= travelled + 235


def test_without_rics_another_mode_opens_them_in_any_case(active: Bench) -> None:
    active.gripper.habits = Habits(opens_without_rics=False)
    active.write(mode=Mode.WIDE)
    assert active.status.initialization is Initialization.CHANGING_MODE


@pytest.mark.parametrize("fault", [Fault.COMMUNICATION_NOT_READY, Fault.SCISSOR_BLOCKED])
@pytest.mark.parametrize("lets_go", [False, True])
def test_a_fault_is_a_halt_for_a_grip(individual: Bench, fault: Fault, lets_go: bool) -> None:
    individual.gripper.habits = Habits(lets_go_on_halt=lets_go)
    individual.gripper.place_object(Finger.ABC, 150)
    individual.close()
    individual.gripper.inject_fault(fault)
    assert bool(individual.gripper.holds) is not lets_go
    individual.write(activate=False)
    assert not individual.gripper.holds


def test_a_grip_that_stays_ends_with_the_power_and_with_a_new_request(individual: Bench) -> None:
    individual.gripper.place_object(Finger.ABC, 150)
    individual.close()
    individual.write(go=False)
    assert individual.gripper.holds == Finger.ABC
    individual.write_and_settle(go=True, axes=(AxisRequest(150, 255, 0),) * 4)
    assert not individual.gripper.holds
    individual.close()
    individual.write(go=False)
    individual.gripper.power_off()
    assert not individual.gripper.holds


# Values.


@pytest.mark.parametrize(
    ("name", "value", "error"),
    [
        *(
            (name, value, error)
            for name in ("activation_time", "status_lag", "silence_fault", "write_spacing")
            for value, error in ((-1, ValueError), (math.nan, ValueError), ("1", TypeError))
        ),
        *((name, 1, TypeError) for name in ("echoes_limits", "lets_go_on_halt", "keeps_status_on_halt")),
        ("opens_without_rics", 1, TypeError),
    ],
)
def test_malformed_habits_are_refused(name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=f"{name} must be"):
        Habits(**{name: value})


@pytest.mark.parametrize("resets", [0, 10])
def test_resets_that_no_emergency_stop_needs(bench: Bench, resets: int) -> None:
    with pytest.raises(ValueError, match="resets"):
        bench.gripper.emergency_stop(resets)
