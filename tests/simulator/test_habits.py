"""Habits of grippers: what the manual leaves open, and what others saw them do beside it."""

from __future__ import annotations

import math
from itertools import groupby
from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.simulator import Habits
from robotiq_async.values.enums import Finger, Initialization, Mode, ObjectStatus
from tests.simulator.stories import tell

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

MOVING, ARRIVED = ObjectStatus.IN_MOTION, ObjectStatus.AT_POSITION


def seconds_of_activation(bench: Bench, **changes: Any) -> float:
    """How long an activation takes, as gIMC shows it."""
    began = bench.now
    bench.write(activate=True, **changes)
    while bench.status.initialization is Initialization.ACTIVATING:
        bench.wait(0.01)
        assert bench.now < began + 100
    return bench.now - began


IN_VAIN = "write rACT=1, wait 60, fault 5, state activating, rests, write rACT=0, fault 0, state reset, "
STORIES = {
    "a reset shows at once, also when the object status is late": "individual, habits status_lag=0.04, "
    "wait 1, write rACT=0 rGTO=0, words 00 00",
    # The fault of silence.
    "the first status after a second shows it once": "active, habits silence_fault=1, fault 0, wait 0.99, "
    "fault 0, wait 1, fault 9, fault 0, fault 0",
    "a write takes it away and nothing stops": "active, habits silence_fault=1, go 255 speed=0, wait 5, "
    "write, fault 0, wait 2, moves, fault 9, settle, at 241 241 241",
    "a serious fault is shown in its place": "on, habits silence_fault=1, wait 1, fault 9, fault 0, "
    "inject 14, wait 5, fault 14",
    # Limits.
    **{
        f"a limit is echoed for {asked}": f"individual, habits echoes_limits=yes, reach S={asked}, "
        f"S arrived at {shown}, S echoes {shown}, write rGTO=0, S echoes {shown}"
        for asked, shown in ((255, 232), (100, 100), (0, 15))
    },
    # No request is looked at while reset.
    "what is a stop and no limit is echoed as asked": "individual, habits echoes_limits=yes, reach 255, "
    "echo 255 255 255 232, write rACT=0 rGTO=0, S echoes 255",
    # The register of the scissor is not used.
    "the limit of the pinch mode is one": "on, habits echoes_limits=yes, write rACT=1 rMOD=1, settle, "
    "reach 255, at 113 113 113 219, echo 113 113 113 255",
    # An emergency stop.
    "it stops, and does not come back by itself": "active, go 255, wait 1, stop, rests, words 19 00, "
    "fault 5, stop-ends, wait 100, words 19 00, fault 5",
    **{
        f"after it {resets} resets are needed": f"active, stop {resets}, stop-ends, {resets * IN_VAIN}"
        "write rACT=1, settle, state complete, fault 0"
        for resets in (1, 2, 9)
    },
    "before its end no reset helps": "active, stop, write rACT=0, write rACT=1, wait 60, fault 5, "
    "write rACT=0, write rACT=1, wait 60, fault 5, stop-ends, write rACT=0, write rACT=1, settle, "
    "state complete",
    "power that was off is as good as resets": "active, stop 9, stop-ends, power-cycle, write rACT=1, "
    "settle, state complete",
    "in it a release does not move": "active, reach 255, stop, write rATR=1, wait 60, at 241 241 241",
    # Asleep.
    "the image that wakes it is echoed and moves nothing, the next does": "individual, sleep, go A=200, "
    "wait 5, A echoes 200, at 6, awake, write, settle, at 200",
    **{
        f"{image} wakes it": f"individual, sleep, {image}, awake, reach A=200, at 200"
        for image in ("write", "write rGTO=0")
    },
    "what moves goes on while it is asleep, and can be stopped": "individual, go A=200, sleep, wait 0.2, "
    "moves, go A=0, wait 0.2, target A 200, sleep, write rGTO=0, rests",
    "an activation and a reset are not ignored": "on, sleep, write rACT=1, settle, state complete, sleep, "
    "write rACT=0, state reset, asleep",
    # What no source settles.
    "with no go there may be no object status": "individual, place A 100, reach A=200, write rGTO=0, "
    "words 71 FE, write rGTO=1, settle, habits keeps_status_on_halt=no, write rGTO=0, words 31 00",
    **{
        f"clearing rICS may open the fingers or not, rGTO={go}": "individual, reach 255, "
        f"habits opens_without_rics=no, write rICS=0 rMOD=0 rGTO={go}, settle, travel A 705, "
        f"at 241 241 241 {scissor}, write rICS=1, habits, write rICS=0, state changing, settle, "
        f"travel A {after}"
        for go, scissor, after in ((0, 232, 940), (1, 137, 1175))
    },
    "without rICS another mode opens them in any case": "active, habits opens_without_rics=no, write rMOD=2, "
    "state changing",
    **{
        f"fault {fault} is a halt for a grip that {'ends' if ends else 'stays'}": f"individual, {habit}, "
        f"place ABC 150, reach 255, inject {fault}, holds{'' if ends else ' ABC'}, write rACT=0, holds"
        for fault in (9, 14)
        for habit, ends in (("habits", False), ("habits lets_go_on_halt=yes", True))
    },
    "a grip that stays ends with the power and a new request": "individual, place ABC 150, reach 255, "
    "write rGTO=0, holds ABC, go 150, settle, holds, reach 255, write rGTO=0, holds ABC, power-off, holds",
    # By the vendor a part stays held when rGTO is cleared; as no one measured it, it may be otherwise.
    **{
        f"an axis grips while it is driven against what it touches, {halted}": f"individual, {habit}, "
        "place A 150, place B 60 opening, reach B=255, grips, go A=200 B=0, grips, settle, grips AB, "
        f"write rGTO=0, grips, {halted}, A closing at 150, write rGTO=1, settle, grips AB, holds AB, "
        "go A=150, grips B, holds B, A arrived at 150"
        for habit, halted in (("habits", "holds AB"), ("habits lets_go_on_halt=yes", "holds"))
    },
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


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
    """A gripper whose object status is 40 ms late; its fingers stand where they were told to."""
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
def test_values_that_are_none(name: str, value: Any, error: type[Exception]) -> None:
    with pytest.raises(error, match=f"{name} must be"):
        Habits(**{name: value})


@pytest.mark.parametrize("resets", [0, 10])
def test_resets_that_no_emergency_stop_needs(bench: Bench, resets: int) -> None:
    with pytest.raises(ValueError, match="resets"):
        bench.gripper.emergency_stop(resets)
