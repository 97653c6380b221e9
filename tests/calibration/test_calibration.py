"""Speeds, forces and times of the values 0..255."""

from __future__ import annotations

import asyncio
import subprocess
import sys
from pathlib import Path
from statistics import mean

import pytest

from robotiq_async import Finger, MoveTimeoutError, RobotiqHand
from robotiq_async.calibration import ForceCalibration, SpeedCalibration
from robotiq_async.calibration.csv_tables import (
    FORCE,
    SPEED_LAYOUT,
    TableError,
    write_table,
)
from robotiq_async.calibration.scales import closing_time
from robotiq_async.calibration.thesis import CLOSING_MS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from tests.virtual import virtual


def test_opening() -> None:
    stroke = THREE_FINGER.stroke
    assert stroke.opening_mm(124) == pytest.approx(77.2, abs=0.1)
    for outside in (-0.1, 155.1, float("nan")):
        with pytest.raises(ValueError, match=r"mm must be millimetres in 0\.0\.\.155\.0"):
            stroke.position_of(outside)


# -- speeds ------------------------------------------------------------------------------------------------


def test_the_thesis_is_the_default_of_the_time_outs() -> None:
    thesis = SpeedCalibration.thesis()
    assert [thesis.closing_time(speed) for speed in range(256)] == [*map(closing_time, range(256))]
    for speed, runs in CLOSING_MS.items():
        assert thesis.closing_time(speed) == pytest.approx(mean(runs) / 1000)


@pytest.mark.parametrize(
    "made",
    [
        "from robotiq_async import RobotiqHand; RobotiqHand('tcp://127.0.0.1')",
        "from robotiq_async.simulator import SimulatedGripper; SimulatedGripper()",
    ],
)
def test_the_table_has_been_read_when_a_hand_or_a_simulated_gripper_is_made(made: str) -> None:
    """They may run in an event loop from then on, and no move is to wait for a disk there."""
    listen = "files = []; sys.addaudithook(lambda event, args: event == 'open' and files.append(args[0]))"
    move = "SpeedCalibration.thesis().closing_time(3); print(files)"
    imported = "from robotiq_async.calibration import SpeedCalibration"
    source = f"import sys; {made}; {imported}; {listen}; {move}"
    run = subprocess.run(
        [sys.executable, "-c", source], capture_output=True, text=True, check=True, timeout=60
    )
    assert run.stdout == "[]\n"


def test_a_part_of_the_way_takes_a_part_of_the_time() -> None:
    thesis = SpeedCalibration.thesis()
    assert thesis.duration(235, 0) == pytest.approx(10.021)
    assert thesis.duration(0, 0) == 0
    assert thesis.duration(47, 0) == pytest.approx(10.021 / 5)


@pytest.mark.parametrize("mm_per_s", [0, 15.0, 73.3])
def test_a_speed_that_no_value_has_is_refused(mm_per_s: float) -> None:
    with pytest.raises(ValueError, match="mm_per_s must be a number in"):
        SpeedCalibration.thesis().speed_value(mm_per_s)


def test_an_owners_table(tmp_path: Path) -> None:
    file = tmp_path / "mine.csv"
    write_table(file, SPEED_LAYOUT, {10: (9000, 11000), 20: (5000, 5000)})
    mine = SpeedCalibration.from_csv(file)
    assert mine.source == str(file)
    assert mine.closing_time(10) == 10
    assert mine.closing_time(15) == pytest.approx(7.5)
    for outside in (9, 21):
        with pytest.raises(ValueError, match=r"lies outside the measured range: 10\.\.20"):
            mine.closing_time(outside)
    for table, words in (
        ({0: (5,)}, "at least two speed values"),
        ({0: (5,), 9: (0,)}, "longer than 0 ms"),
    ):
        write_table(file, SPEED_LAYOUT, table)
        with pytest.raises(TableError, match=words):
            SpeedCalibration.from_csv(file)


# -- the hand ----------------------------------------------------------------------------------------------


class Lame:
    """The clock of a gripper that is a hundred times as slow as life, from some moment on."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()
        self._since: float | None = None

    def __call__(self) -> float:
        time = self._loop.time()
        return time if self._since is None else self._since + (time - self._since) / 100

    def slow_down(self) -> None:
        self._since = self._loop.time()


@virtual
async def test_the_default_time_out_of_a_move_comes_from_the_calibration(tmp_path: Path) -> None:
    write_table(tmp_path / "slow.csv", SPEED_LAYOUT, {0: (90_000,), 255: (60_000,)})
    slow = SpeedCalibration.from_csv(tmp_path / "slow.csv")
    for calibration, seconds in ((None, 2.119), (slow, 60)):
        clock = Lame()
        gripper = SimulatedGripper(clock, device_cycle=0.0)
        async with (
            SimulatorServer(gripper) as server,
            RobotiqHand(server.address, calibration=calibration, poll_interval=0.1) as hand,
        ):
            clock.slow_down()
            way = 255 - hand.status.position(Finger.A)
            began = asyncio.get_running_loop().time()
            with pytest.raises(MoveTimeoutError):
                await hand.move(255, Finger.A, speed=255)
            timeout = asyncio.get_running_loop().time() - began
        assert timeout == pytest.approx(2 * way / 235 * seconds + 2, rel=0.005)


def test_a_calibration_that_does_not_reach_over_all_speeds_is_refused(tmp_path: Path) -> None:
    write_table(tmp_path / "part.csv", SPEED_LAYOUT, {0: (9000,), 200: (5000,)})
    with pytest.raises(ValueError, match=r"must reach over the speed values 0\.\.255, got 0\.\.200"):
        RobotiqHand(calibration=SpeedCalibration.from_csv(tmp_path / "part.csv"))


# -- forces ------------------------------------------------------------------------------------------------


def test_nominal_forces_are_the_manuals() -> None:
    nominal = ForceCalibration.nominal()
    assert (nominal.newton(0), nominal.newton(255)) == (15, 60)
    assert nominal.force_value(30) == 85
    with pytest.raises(ValueError, match="newton must be a number in"):
        nominal.force_value(61)


def test_grams_become_newton(tmp_path: Path) -> None:
    foam = ForceCalibration.thesis("foam")
    assert foam.newton(0) == pytest.approx(mean((630, 650, 570)) / 1000 * 9.81)
    with pytest.raises(ValueError, match="outside the measured range"):
        foam.newton(255)
    with pytest.raises(ValueError, match="surface must be 'foam' or 'rigid'"):
        ForceCalibration.thesis("wood")
    write_table(tmp_path / "f.csv", FORCE, {0: (1000,), 100: (2000,)})
    mine = ForceCalibration.from_csv(tmp_path / "f.csv")
    assert mine.newton(50) == pytest.approx(1.5 * 9.81)
    assert mine.force_value(1.5 * 9.81) == 50
    write_table(tmp_path / "f.csv", FORCE, {0: (1000,)})
    with pytest.raises(TableError, match="at least two"):
        ForceCalibration.from_csv(tmp_path / "f.csv")


# -- by hand -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (((0, 1.0),), "at least two are needed, got 1"),
        (((0, 1.0), (256, 1.0)), "a value of points must be in 0..255"),
        (((0, 1.0), (0, 2.0)), "the values must rise"),
        (((9, 1.0), (0, 2.0)), "the values must rise"),
        (((0, float("nan")), (255, 1.0)), "a figure of points must be a number"),
        (((0, -1.0), (255, 1.0)), "a figure of points must be a number"),
        (((0, 1e9), (255, 1.0)), "a figure of points must be a number"),
    ],
)
def test_points_that_are_no_curve_are_refused(points: tuple[tuple[int, float], ...], words: str) -> None:
    for kind in (SpeedCalibration, ForceCalibration):
        with pytest.raises(ValueError, match=words.replace(".", r"\.")):
            kind("mine", points)


def test_no_closing_takes_no_time() -> None:
    with pytest.raises(ValueError, match="must be above 0"):
        SpeedCalibration("mine", ((0, 1.0), (255, 0.0)))
