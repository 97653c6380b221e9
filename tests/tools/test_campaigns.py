"""Measuring as the thesis did: on the simulated gripper, whose speeds are the thesis's."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from pathlib import Path

import pytest

from robotiq_async import HAND_E, THREE_FINGER, TWO_FINGER_85, Finger, RobotiqHand
from robotiq_async.calibration import SpeedCalibration
from robotiq_async.calibration.csv_tables import (
    FORCE,
    SPEED_LAYOUT,
    TableError,
    read_table,
)
from robotiq_async.calibration.motion_profile import PRESSING_S
from robotiq_async.calibration.scales import closing_time
from robotiq_async.calibration.thesis import CLOSING_MS, FOAM_GRAMS, RIGID_GRAMS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.simulator.physics.axis import peak
from robotiq_async.simulator.physics.scale import SimulatedScale
from robotiq_async.tools.errors import MeasuringError
from robotiq_async.tools.measure.campaigns import (
    GRASP_S,
    RUN_PAUSE_S,
    Campaign,
    expected_seconds,
    force_campaign,
    force_values,
    grasp,
    peak_currents,
    read_currents,
    speed_campaign,
    speed_values,
    time_closing,
    write_currents,
)
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop, virtual

POLL_S = 0.005


@asynccontextmanager
async def active(
    speedup: float = 1.0, poll: float = POLL_S
) -> AsyncIterator[tuple[SimulatedGripper, RobotiqHand]]:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, speedup=speedup)
    await activate_beforehand(gripper)
    async with SimulatorServer(gripper) as server, RobotiqHand(server.address, poll_interval=poll) as hand:
        yield gripper, hand


# -- the order -------------------------------------------------------------------------------------------


def test_the_values_are_those_of_the_thesis_in_its_order() -> None:
    assert speed_values() == sorted(CLOSING_MS)
    assert speed_values(100) == [0, 100, 200, 255]
    assert force_values() == [0, 50, 100, 150, 200, 250, 225, 175, 125, 75, 25]
    assert sorted(force_values()) == sorted(FOAM_GRAMS)


# -- speed -------------------------------------------------------------------------------------------------


@virtual
@pytest.mark.parametrize(
    ("speedup", "speeds"), [(1.0, (0, 255)), (10.0, (0, 30, 60, 128, 200, 255))], ids=["1", "10"]
)
async def test_closing_times_are_those_of_the_thesis(speedup: float, speeds: tuple[int, ...]) -> None:
    async with active(speedup) as (_, hand):
        for speed in speeds:
            seconds = await time_closing(hand, speed, Finger.ABC, speedup)
            expected = closing_time(speed)
            assert expected <= seconds <= 1.01 * expected + 2 * POLL_S * speedup


def test_the_time_of_a_run_is_that_of_the_model() -> None:
    """The bar of a 2F-85 took the 10 s of a 3-Finger for its slowest closing, which takes 4.3."""
    fast = SpeedCalibration.usual(TWO_FINGER_85).closing_time(255)
    assert expected_seconds(TWO_FINGER_85, 0) == pytest.approx(4.3 + fast + RUN_PAUSE_S, abs=0.1)
    assert expected_seconds(THREE_FINGER, 0) > 10


@virtual
async def test_only_the_fingers_asked_for_move_and_one_that_meets_something_is_refused() -> None:
    async with active() as (gripper, hand):
        with pytest.raises(ValueError, match="got the scissor"):
            await time_closing(hand, 255, Finger.ALL)
        before = gripper.travel(Finger.A)
        await time_closing(hand, 255, Finger.B)
        assert gripper.travel(Finger.A) == before
        gripper.place_object(Finger.B, 150)
        with pytest.raises(MeasuringError, match=r"met something \(.*B"):
            await time_closing(hand, 255, Finger.ABC)


@virtual
async def test_an_opening_that_is_blocked_is_no_full_closing() -> None:
    async with active() as (gripper, hand):
        await hand.close(speed=255)
        gripper.place_object(Finger.ABC, 150, opening=True)
        with pytest.raises(MeasuringError, match="met something"):
            await time_closing(hand, 255, Finger.ABC)
        with pytest.raises(MeasuringError, match="blocks the opening"):
            await grasp(hand, 200, 255)


def hold_up_after(seconds: float, times: int) -> None:
    """Hold up the loop for half a second, so often, from some time on."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    virtual = loop

    def hold_up(left: int) -> None:
        virtual.hold_up(0.5)
        if left > 1:
            virtual.call_later(1.0, hold_up, left - 1)

    loop.call_later(seconds, hold_up, times)


@virtual
async def test_a_run_in_which_the_loop_was_held_up_is_measured_again() -> None:
    async with active() as (_, hand):
        hold_up_after(1.0, 1)
        began = asyncio.get_running_loop().time()
        seconds = await time_closing(hand, 255, Finger.ABC)
        assert seconds == pytest.approx(closing_time(255), rel=0.02)
        assert asyncio.get_running_loop().time() - began > 2 * closing_time(255)


@virtual
async def test_a_loop_that_is_held_up_all_the_time_is_no_place_to_measure() -> None:
    async with active(poll=0.05) as (_, hand):
        hold_up_after(1.0, 100)
        with pytest.raises(MeasuringError, match="too busy to measure"):
            await time_closing(hand, 255, Finger.ABC)


# -- force -------------------------------------------------------------------------------------------------


@virtual
async def test_the_currents_of_a_grasp() -> None:
    async with active() as (gripper, hand):
        with pytest.raises(MeasuringError, match="closed on nothing"):
            await grasp(hand, 200, 255)
        gripper.place_object(Finger.ABC, 150)
        samples = await grasp(hand, 200, 255)
        times = [sample[0] for sample in samples]
        assert times == sorted(times)
        assert times[0] < 50
        moving = 1000 * closing_time(255) * (150 - 6) / 235
        assert times[-1] == pytest.approx(moving + 1000 * (PRESSING_S + GRASP_S), abs=50)
        assert len(samples) == pytest.approx(times[-1] / 1000 / POLL_S, rel=0.02)  # every poll
        assert peak_currents([samples]) == (10 * round(peak(200)),) * 3
        assert samples[-1][1:] == (0, 0, 0), "what is held draws nothing"


def test_the_currents_survive_a_file(tmp_path: Path) -> None:
    file = tmp_path / "currents.csv"
    currents = {50: [[(0, 1, 2, 3), (5, 4, 5, 6)], [(0, 7, 8, 9)]], 0: [[(0, 0, 0, 2550)]]}
    write_currents(file, currents)
    assert read_currents(file) == currents


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("a,b\n", "line 1: expected the columns force_value,run,time_ms,a_ma,b_ma,c_ma"),
        ("force_value,run,time_ms,a_ma,b_ma,c_ma\n0,1,2,3,4\n", "line 2: expected 6 columns, got 5"),
        (
            "force_value,run,time_ms,a_ma,b_ma,c_ma\n0,1,2,3,4,x\n",
            "line 2: c_ma must be an integer in 0..2550",
        ),
        ("force_value,run,time_ms,a_ma,b_ma,c_ma\n0,2,2,3,4,5\n", "line 2: run 2 of force 0 is out of order"),
    ],
)
def test_bad_currents_are_refused(tmp_path: Path, text: str, words: str) -> None:
    file = tmp_path / "currents.csv"
    file.write_text(text, encoding="utf-8")
    with pytest.raises(TableError) as caught:
        read_currents(file)
    assert words in str(caught.value)


# -- campaigns ---------------------------------------------------------------------------------------------


class PowerCutError(Exception):
    pass


async def test_an_interrupted_campaign_goes_on_where_it_was(tmp_path: Path) -> None:
    file = tmp_path / "table.csv"
    asked: list[tuple[int, int]] = []

    async def measure(value: int, number: int) -> int:
        if (value, number) == (170, 2) and (170, 2) not in asked:
            asked.append((value, number))
            raise PowerCutError
        asked.append((value, number))
        return 1000 * number + value

    with pytest.raises(PowerCutError):
        await speed_campaign(file, step=85, runs=2).measure(measure)
    assert read_table(file, SPEED_LAYOUT) == {0: (1000, 2000), 85: (1085, 2085)}
    asked.clear()
    asked.append((170, 2))
    again = speed_campaign(file, step=85, runs=2)
    assert again.left == [170, 255]
    await again.measure(measure)
    assert asked[1:] == [(170, 1), (170, 2), (255, 1), (255, 2)]
    assert sorted(read_table(file, SPEED_LAYOUT)) == [0, 85, 170, 255]
    assert speed_campaign(file, step=85, runs=2).left == []


async def test_a_table_says_on_which_model_it_was_measured(tmp_path: Path) -> None:
    file, cut = tmp_path / "table.csv", True

    async def measure(value: int, number: int) -> int:
        if cut and value > 100:
            raise PowerCutError
        return 1000

    with pytest.raises(PowerCutError):
        await speed_campaign(file, step=85, runs=1).measure(measure, HAND_E)
    cut = False
    with pytest.raises(TableError, match="was measured on a Hand-E, and the gripper is a 2F-85"):
        await speed_campaign(file, step=85, runs=1).measure(measure, TWO_FINGER_85)
    await speed_campaign(file, step=85, runs=1).measure(measure, HAND_E)
    assert SpeedCalibration.from_csv(file).model is HAND_E


async def test_a_reading_beyond_the_table_is_refused_and_not_written(tmp_path: Path) -> None:
    file, reading = tmp_path / "table.csv", 100_001

    async def measure(value: int, number: int) -> int:
        return reading

    with pytest.raises(TableError, match="a reading of 100001 is beyond"):
        await Campaign(file, FORCE, [0], 1).measure(measure)
    assert not file.exists()
    reading = 5
    await force_campaign(file, step=250, runs=2).measure(measure)
    with pytest.raises(TableError, match="has 2 runs instead of 3"):
        force_campaign(file, step=250, runs=3)
    with pytest.raises(TableError, match="there is no folder"):
        speed_campaign(tmp_path / "nowhere" / "table.csv")


# -- the scale ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("surface", ["foam", "rigid"])
def test_the_simulated_scale_shows_what_the_thesis_s_showed(surface: str) -> None:
    scale = SimulatedScale(surface)  # type: ignore[arg-type]
    for force, runs in {"foam": FOAM_GRAMS, "rigid": RIGID_GRAMS}[surface].items():
        readings = {scale.reading(force) for _ in range(200)}
        assert min(runs) <= min(readings)
        assert max(readings) <= max(runs)
        assert len(readings) > 1 or max(runs) - min(runs) <= 10


def test_the_same_seed_the_same_readings() -> None:
    one, two, other = SimulatedScale("foam", 1), SimulatedScale("foam", 1), SimulatedScale("foam", 2)
    readings = [[scale.reading(force) for force in range(256)] for scale in (one, two, other)]
    assert readings[0] == readings[1] != readings[2]
    with pytest.raises(ValueError, match="surface must be 'foam' or 'rigid'"):
        SimulatedScale("wood")  # type: ignore[arg-type]
