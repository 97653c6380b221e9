"""``robotiq-async measure``."""

from __future__ import annotations

import asyncio
import signal
from asyncio.subprocess import PIPE
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli import main
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.measure.campaigns import read_currents
from robotiq_async.values.calibration.csv_tables import FORCE, SPEED, read_table, thesis_table
from tests.cli.conftest import served

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Outcome, Shell


def files_in(folder: Path) -> list[str]:
    return sorted(path.name for path in folder.iterdir())


@pytest.mark.usefixtures("virtually")
def test_speed_writes_table_and_pictures(call: Call, tmp_path: Path) -> None:
    table = tmp_path / "mine.csv"
    options = ("--output", str(table), "--step", "128", "--runs", "1", "--speedup", "30")
    outcome = call("measure", "speed", "sim://", *options)
    outcome.assert_succeeded()
    written = [tmp_path / name for name in ("mine.csv", "mine.png", "mine.svg")]
    assert outcome.out.splitlines()[-3:] == [str(file) for file in written]
    assert files_in(tmp_path) == ["mine.csv", "mine.csv.origin.csv", "mine.png", "mine.svg"]
    assert sorted(read_table(table, SPEED)) == [0, 128, 255]
    for line in ("speed 0: ", "speed 128: ", "speed 255: "):
        assert line in outcome.out
    # Complete: nothing is measured again, the pictures are made anew, byte for byte.
    before = {file: file.read_bytes() for file in written}
    outcome = call("measure", "speed", "sim://", *options)
    outcome.assert_succeeded()
    assert outcome.err == ""
    assert outcome.out.startswith(f"{table} is complete: nothing is measured again.")
    assert {file: file.read_bytes() for file in written} == before


@pytest.mark.usefixtures("virtually")
def test_force_writes_readings_currents_and_pictures(call: Call, tmp_path: Path) -> None:
    for surface in ("foam", "rigid"):
        table = tmp_path / f"force_{surface}_grams.csv"
        outcome = call(
            *("measure", "force", "sim://", "--surface", surface, "--output", str(table)),
            *("--step", "125", "--runs", "2", "--speed", "255", "--speedup", "30"),
        )
        outcome.assert_succeeded()
        readings = read_table(table, FORCE)
        assert sorted(readings) == [0, 125, 250]
        thesis = thesis_table(f"force_{surface}_grams", FORCE)
        for force, runs in readings.items():
            assert all(min(thesis[force]) <= reading <= max(thesis[force]) for reading in runs)
        currents = read_currents(tmp_path / f"force_{surface}_grams_currents.csv")
        assert {force: len(runs) for force, runs in currents.items()} == {0: 2, 125: 2, 250: 2}
        for name in ("grams", "grams_currents_peak", "grams_currents_over_time"):
            assert (tmp_path / f"force_{surface}_{name}.svg").stat().st_size > 5000
            assert (tmp_path / f"force_{surface}_{name}.png").stat().st_size > 5000
    both = (tmp_path / "force_rigid_grams_currents_over_time.svg").read_text(encoding="utf-8")
    assert "foam" in both


async def test_the_scale_is_read_by_a_person(
    shell: Shell, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("PYTHONIOENCODING", "utf-8:strict")  # no language is to hide that a byte is none
    gripper = SimulatedGripper(speedup=30)
    gripper.place_object(7, 150)
    async with SimulatorServer(gripper) as server:
        process = await shell.start(
            *("measure", "force", "--yes", server.address, "--output", str(tmp_path / "f.csv")),
            *("--step", "250", "--runs", "1", "--speed", "255", "--no-plot"),
            stdin=PIPE,
        )
        assert process.stdin is not None
        process.stdin.write(b"much\n-5\n\xff\n1500\n2500\n")
        outcome = await shell.finish(process)
    outcome.assert_succeeded()
    assert outcome.out.count("An integer in 0..100000, please.") == 3
    assert "Force 250, run 1: what does the scale show, in grams?" in outcome.out
    assert read_table(tmp_path / "f.csv", FORCE) == {0: (1500,), 250: (2500,)}


def test_nobody_there_to_read_the_scale(call: Call, tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=30)
    gripper.place_object(7, 150)
    with served(gripper) as server:
        outcome = call(
            *("measure", "force", "--yes", server.address, "--output", str(tmp_path / "f.csv")),
            *("--step", "250", "--runs", "1", "--speed", "255", "--no-plot"),
        )
    assert outcome.code == 1
    assert "no answer: the input has ended" in outcome.err
    assert not (tmp_path / "f.csv").exists()


@pytest.mark.usefixtures("virtually")
def test_the_scale_is_read_from_a_table(call: Call, tmp_path: Path) -> None:
    readings = tmp_path / "readings.csv"
    readings.write_text("force_value,run_1_g\n0,1111\n250,2222\n", encoding="utf-8")
    options = (
        "--output",
        str(tmp_path / "f.csv"),
        "--speed",
        "255",
        "--speedup",
        "30",
        "--no-plot",
        "--runs",
        "1",
    )
    outcome = call("measure", "force", "sim://", "--scale", str(readings), "--step", "250", *options)
    outcome.assert_succeeded()
    assert read_table(tmp_path / "f.csv", FORCE) == {0: (1111,), 250: (2222,)}
    outcome = call("measure", "force", "sim://", "--scale", str(readings), "--step", "125", *options)
    outcome.assert_failed(1, "has no 1 runs for the force values [125]")


async def test_ctrl_c_keeps_the_rows_and_stops_the_fingers(shell: Shell, tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=30)
    async with SimulatorServer(gripper) as server:
        table = tmp_path / "t.csv"
        process = await shell.start(
            *("measure", "speed", "--yes", server.address),
            *("--output", str(table), "--runs", "1", "--no-plot"),
        )
        async with asyncio.timeout(20):
            while not table.exists() or not gripper.is_moving:  # noqa: ASYNC110  # another process writes it
                await asyncio.sleep(0.01)
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
        assert outcome.code == 130
        assert not gripper.is_moving
    rows = read_table(table, SPEED)
    assert 0 in rows
    assert files_in(tmp_path) == ["t.csv", "t.csv.origin.csv"]


def test_fingers_that_meet_something_end_it(call: Call, tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=30)
    gripper.place_object(7, 150)
    with served(gripper) as server:
        outcome = call(
            *("measure", "speed", "--yes", server.address, "--output", str(tmp_path / "t.csv"), "--no-plot")
        )
    assert outcome.code == 1
    assert "the fingers met something" in outcome.err
    assert "nothing was written" in outcome.err
    assert "t.csv" not in outcome.err, "there is no such file"


def test_without_matplotlib_nothing_is_begun(
    call: Call, without: Callable[[str], None], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.chdir(tmp_path)
    without("matplotlib")
    call("measure", "speed", "sim://").assert_failed(1, "pip install 'matplotlib", "--no-plot")
    assert files_in(tmp_path) == []


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["speed", "sim://", "--runs", "0"], "--runs must be an integer in 1..100, got 0"),
        (["speed", "sim://", "--step", "0"], "--step must be an integer in 1..255, got 0"),
        (["speed", "sim://", "--speedup", "51"], "--speedup must be a number in 1..50, got 51"),
        (["speed", "192.168.1.11", "--speedup", "2"], "--speedup is for sim:// only"),
        (["speed", "sim://?speedup=2"], "takes no option but ?model=; there is --speedup"),
        (["force", "sim://?model=2f85"], "with three fingers, and sim://?model=2f85 names a 2F-85"),
        (["speed", "tcp://"], "malformed address"),
        (["speed", "sim://", "--output", "mine.png"], "--output must be a file named .csv, got 'mine.png'"),
        (["speed", "sim://", "--output", "mine"], "--output must be a file named .csv"),
        (["force", "sim://", "--output", "."], "--output must be a file named .csv"),
        (["speed", "sim://", "--fingers", "scissor"], "--fingers takes A, B and C only"),
        (["force", "sim://", "--output", "a.csv", "--scale", "a.csv"], "--scale must be another file than"),
        (["force", "sim://", "--surface", "wood"], "wood"),
        (["force", "sim://", "--speed", "256"], "256"),
    ],
)
def test_wrong_usage(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["measure", *arguments]) == 2
    assert words in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed_value\n", "line 1: expected the columns"),
        ("speed_value,run_1_ms\n0,5\n", "has 1 runs instead"),
    ],
)
def test_a_bad_table_is_refused(
    text: str, words: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    table = tmp_path / "t.csv"
    table.write_text(text, encoding="utf-8")
    assert main(["measure", "speed", "sim://", "--output", str(table)]) == 1
    assert words in capsys.readouterr().err
    assert table.read_text(encoding="utf-8") == text


QUICK = ("--runs", "1", "--no-plot")


def gave_up(outcome: Outcome, *words: str) -> None:
    """It ended with 1 and said why, without a traceback."""
    assert outcome.code == 1
    assert "Traceback" not in outcome.err
    for word in words:
        assert word in outcome.err


@pytest.mark.usefixtures("virtually")
def test_what_was_measured_on_another_gripper_is_not_gone_on_with(call: Call, tmp_path: Path) -> None:
    table = str(tmp_path / "t.csv")
    first = call("measure", "speed", "sim://", "--output", table, "--step", "255", "--speedup", "30", *QUICK)
    first.assert_succeeded()
    for options in (("10.255.255.1",), ("sim://", "--fingers", "A")):
        outcome = call("measure", "speed", *options, "--output", table, "--step", "255", *QUICK)
        outcome.assert_failed(1, "was measured with other settings")


@pytest.mark.usefixtures("virtually")
def test_another_surface_is_another_table(call: Call, tmp_path: Path) -> None:
    table = str(tmp_path / "t.csv")
    options = ("--output", table, "--step", "250", "--speed", "255", "--speedup", "30", *QUICK)
    call("measure", "force", "sim://", *options).assert_succeeded()
    outcome = call("measure", "force", "sim://", "--surface", "rigid", *options)
    outcome.assert_failed(1, "was measured with other settings: surface foam there and rigid here")


@pytest.mark.usefixtures("virtually")
def test_readings_without_their_currents_are_refused(call: Call, tmp_path: Path) -> None:
    table, currents = tmp_path / "t.csv", tmp_path / "t_currents.csv"
    options = ("--output", str(table), "--step", "250", "--speed", "255", "--speedup", "30", "--no-plot")
    call("measure", "force", "sim://", *options, "--runs", "2").assert_succeeded()
    whole = currents.read_bytes()
    for damage in ("gone", "empty", "short"):
        currents.write_bytes(whole)
        damaged(currents, damage)
        outcome = call("measure", "force", "sim://", *options, "--runs", "2")
        outcome.assert_failed(1, "t_currents.csv")


def damaged(file: Path, how: str) -> None:
    if how == "gone":
        file.unlink()
    elif how == "empty":
        file.write_text(file.read_text(encoding="utf-8").splitlines()[0] + "\n", encoding="utf-8")
    else:
        lines = file.read_text(encoding="utf-8").splitlines(keepends=True)
        file.write_text("".join(line for line in lines if not line.startswith("0,2,")), encoding="utf-8")


@pytest.mark.usefixtures("virtually")
def test_a_picture_that_cannot_be_written_is_one_line(call: Call, tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    (tmp_path / "t.png").mkdir()
    options = ("--output", str(table), "--step", "255", "--runs", "1", "--speedup", "30")
    outcome = call("measure", "speed", "sim://", *options)
    gave_up(outcome, "t.png")
    assert len(read_table(table, SPEED)) == 2


def test_a_name_that_is_too_long_is_one_line(call: Call, tmp_path: Path) -> None:
    name = str(tmp_path / ("x" * 300 + ".csv"))
    call("measure", "speed", "sim://", "--output", name, *QUICK).assert_failed(1, "File name too long")
