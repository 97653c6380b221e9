"""``robotiq-async measure``."""

from __future__ import annotations

import asyncio
import os
import signal
from asyncio.subprocess import PIPE
from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.calibration.csv_tables import (
    FORCE,
    SPEED_LAYOUT,
    read_stroke,
    read_table,
)
from robotiq_async.calibration.thesis import FOAM_GRAMS, RIGID_GRAMS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.measure.campaigns import read_currents
from robotiq_async.values.request import Request
from tests.cli.conftest import draw_nothing, served

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


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
    assert sorted(read_table(table, SPEED_LAYOUT)) == [0, 128, 255]
    for line in ("speed 0: ", "speed 128: ", "speed 255: "):
        assert line in outcome.out
    # Complete: nothing is measured again, the pictures are made again, byte for byte.
    before = {file: file.read_bytes() for file in written}
    outcome = call("measure", "speed", "sim://", *options)
    outcome.assert_succeeded()
    assert outcome.err == ""
    assert outcome.out.startswith(f"{table} is complete: nothing is measured again.")
    assert {file: file.read_bytes() for file in written} == before


@pytest.mark.usefixtures("virtually")
def test_force_writes_readings_currents_and_pictures(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """The pictures have their words, and are not drawn: tests/tools/test_plots.py looks at them."""
    drawn: list[set[str]] = []
    draw_nothing(monkeypatch, drawn)
    for surface in ("foam", "rigid"):
        table = tmp_path / f"force_{surface}_grams.csv"
        drawn.clear()
        outcome = call(
            *("measure", "force", "sim://", "--surface", surface, "--output", str(table)),
            *("--step", "125", "--runs", "2", "--speed", "255", "--speedup", "30"),
        )
        outcome.assert_succeeded()
        readings = read_table(table, FORCE)
        assert sorted(readings) == [0, 125, 250]
        thesis = {"foam": FOAM_GRAMS, "rigid": RIGID_GRAMS}[surface]
        for force, runs in readings.items():
            assert all(min(thesis[force]) <= reading <= max(thesis[force]) for reading in runs)
        currents = read_currents(tmp_path / f"force_{surface}_grams_currents.csv")
        assert {force: len(runs) for force, runs in currents.items()} == {0: 2, 125: 2, 250: 2}
        for name in ("grams", "grams_currents_peak", "grams_currents_over_time"):
            for suffix in ("svg", "png"):
                assert (tmp_path / f"force_{surface}_{name}.{suffix}").stat().st_size > 100
    words = set().union(*drawn)
    assert {"force, N (F = m g, g = 9.81 m/s²)", "highest current, mA", "current, mA"} <= words
    assert {"rigid", "foam", "force 0", "force 125", "force 250"} <= words, "beside the currents of the other"


def test_the_scale_is_read_by_a_person(call: Call, tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=30)
    gripper.place_object(7, 150)
    with served(gripper) as server:
        outcome = call(
            *("measure", "force", "--yes", server.address, "--output", str(tmp_path / "f.csv")),
            *("--step", "250", "--runs", "1", "--speed", "255", "--no-plot"),
            stdin=b"much\n-5\n\xff\n1500\n2500\n",
        )
    outcome.assert_succeeded()
    assert outcome.out.count("An integer in 0..100000, please.") == 3
    assert "Force 250, run 1: what does the scale show, in grams?" in outcome.out
    assert read_table(tmp_path / "f.csv", FORCE) == {0: (1500,), 250: (2500,)}


@pytest.mark.usefixtures("virtually")
def test_stroke_writes_the_points_of_a_jaw(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "stroke.csv"
    arguments = ("measure", "stroke", "sim://?model=2f85", "--output", str(file))
    outcome = call(*arguments, "--points", "3")
    outcome.assert_succeeded()
    assert outcome.out.splitlines()[-1] == str(file)
    points = read_stroke(file, TWO_FINGER_85)
    assert len(points) == 3
    assert [mm for _, mm in points] == [TWO_FINGER_85.stroke.opening_mm(position) for position, _ in points]
    call(*arguments).assert_failed(2, "exists: choose another --output, or pass --overwrite")
    call(*arguments, "--overwrite").assert_succeeded()
    assert len(read_stroke(file)) == 5
    call("status", "sim://?model=2f85", "--stroke", str(file)).assert_succeeded()
    call("status", f"sim://?model=2f85&stroke={file}").assert_succeeded()
    call(*arguments, "--overwrite", "--points", "50").assert_succeeded()
    assert 40 <= len(read_stroke(file)) < 50, "at its ends a jaw stays where it is"
    refused = call("status", f"sim://?model=2f140&stroke={file}")
    refused.assert_failed(2, f"stroke: {file}: it was measured on a 2F-85, and the gripper is a 2F-140")


def test_stroke_asks_for_figures_that_fall_until_the_fingertips_meet(call: Call, tmp_path: Path) -> None:
    """Fingertips of one's own meet before the end of the gripper: the contact is the closed end."""
    gripper = SimulatedGripper(speedup=20, model="2f85")
    gripper.place_object(JAW, position=180)
    with served(gripper) as server:
        file = tmp_path / "s.csv"
        outcome = call(
            *("measure", "stroke", "--yes", server.address, "--output", str(file), "--points", "3"),
            stdin=b"wide\n101.25\n101.3\n52\n0\n",
        )
    outcome.assert_succeeded()
    assert outcome.out.count("Millimetres with at most two decimals, such as 42.5, please.") == 1
    again = "positions must rise and openings fall, got 101.25 mm at "
    assert outcome.out.count(again) == 1
    assert "The fingertips met at" in outcome.out
    points = read_stroke(file)
    assert [mm for _, mm in points] == [101.25, 52, 0]
    assert abs(points[-1][0] - 180) <= 5
    assert gripper.writes[-1].registers[0] & 0x0800 == 0, "the jaw is stopped at the end"


@pytest.mark.parametrize(
    ("figures", "is_doubted"),
    [
        (b"8.5\n6.6\n4.3\n2.1\n0\n", True),
        (b"850\n660\n430\n210\n0\n", True),
        (b"120\n98\n75\n52\n31\n", False),
    ],
)
def test_stroke_doubts_figures_that_are_no_millimetres(
    figures: bytes, is_doubted: bool, call: Call, tmp_path: Path
) -> None:
    """Centimetres made a table like any other, and 8 mm then was an open jaw."""
    with served(SimulatedGripper(speedup=20, model="2f85")) as server:
        file = tmp_path / "s.csv"
        outcome = call("measure", "stroke", "--yes", server.address, "--output", str(file), stdin=figures)
    outcome.assert_succeeded()
    assert outcome.out.count("If the\ncalliper is not in millimetres, press Ctrl-C") == is_doubted
    assert file.exists(), "it may be right"


def test_stroke_does_not_measure_what_it_cannot_write(call: Call, tmp_path: Path) -> None:
    outcome = call("measure", "stroke", "sim://?model=2f85", "--output", str(tmp_path / "none" / "s.csv"))
    outcome.assert_failed(1, f"{tmp_path}/none/s.csv: its folder does not exist, or cannot be written to")
    assert "calliper" not in outcome.out


async def test_stroke_ends_where_the_fingertips_touch(shell: Shell, tmp_path: Path) -> None:
    """Soft ones touch before the gripper's end, and no calliper shows less than 0."""
    async with SimulatorServer(SimulatedGripper(speedup=20, model="2f85")) as server:
        file = tmp_path / "s.csv"
        process = await shell.start(
            *("measure", "stroke", "--yes", server.address, "--output", str(file), "--points", "4"),
            stdin=PIPE,
        )
        assert process.stdin is not None
        process.stdin.write(b"0\n85\n84.9\n40\n0\n")
        outcome = await shell.finish(process)
    outcome.assert_succeeded()
    assert outcome.out.count("an open jaw cannot have an opening of 0 mm. Please measure again.") == 1
    assert outcome.out.count("an opening must fall by 0.02 mm a count or more, got 85 mm at ") == 1
    assert "The fingertips touch at " in outcome.out
    assert [mm for _, mm in read_stroke(file)] == [85, 40, 0]


def test_stroke_needs_a_yes_without_a_terminal(call: Call, tmp_path: Path) -> None:
    address = "tcp://127.0.0.1:1?model=2f85"
    outcome = call("measure", "stroke", address, "--output", str(tmp_path / "s.csv"), stdin=b"y\n")
    outcome.assert_failed(2, "--yes", "127.0.0.1:1")


def test_stroke_without_an_answer_writes_nothing(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "s.csv"
    with served(SimulatedGripper(speedup=20, model="2f85")) as server:
        outcome = call(*("measure", "stroke", "--yes", server.address, "--output", str(file)), stdin=b"85\n")
    outcome.assert_failed(1, "no answer: the input ended")
    assert not file.exists()


async def test_ctrl_c_instead_of_an_answer(shell: Shell, tmp_path: Path) -> None:
    """The thread that waits for the answer waits on, and must not hold what the interpreter needs to end."""
    gripper = SimulatedGripper(speedup=20, model="2f85")
    async with SimulatorServer(gripper) as server:
        process = await shell.start(
            *("measure", "stroke", "--yes", server.address, "--output", str(tmp_path / "s.csv")), stdin=PIPE
        )
        assert process.stdin is not None
        assert process.stdout is not None
        process.stdin.write(b"85\nwide\n")  # of two lines at once the second is no less an answer
        await process.stdout.readuntil(b"such as 42.5, please.\n")
        await process.stdout.readuntil(b"in mm?")
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
        assert (outcome.code, outcome.err) == (130, "robotiq-async: interrupted\n")
        assert not gripper.is_moving
    assert files_in(tmp_path) == []


@pytest.mark.usefixtures("virtually")
def test_ctrl_c_keeps_the_rows_and_stops_the_fingers(
    call: Call, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In virtual time: on a busy machine a run is repeated, and in the end there is no row."""
    table, write = tmp_path / "t.csv", SimulatedGripper.write
    interrupted: list[SimulatedGripper] = []

    def interrupt(gripper: SimulatedGripper) -> None:
        assert gripper.is_moving
        os.kill(os.getpid(), signal.SIGINT)

    def interrupting(gripper: SimulatedGripper, offset: int, registers: Sequence[int]) -> None:
        write(gripper, offset, registers)
        if table.exists() and not interrupted:
            interrupted.append(gripper)
            asyncio.get_running_loop().call_later(0.03, interrupt, gripper)

    monkeypatch.setattr(SimulatedGripper, "write", interrupting)
    options = ("--output", str(table), "--runs", "1", "--no-plot", "--speedup", "30")
    call("measure", "speed", "sim://", *options).assert_failed(130, "interrupted")
    assert not Request.from_registers(interrupted[0].writes[-1].registers).go
    rows = read_table(table, SPEED_LAYOUT)
    assert 0 in rows
    assert files_in(tmp_path) == ["t.csv", "t.csv.origin.csv"]


# -- in one line -------------------------------------------------------------------------------------------

SPEEDS = ("measure", "speed", "sim://", "--step", "255", "--runs", "1", "--no-plot", "--speedup", "30")
FORCES = ("measure", "force", "sim://", "--step", "250", "--speed", "255", "--no-plot", "--speedup", "30")
IN_THE_WAY = ("--yes", "--step", "250", "--runs", "1", "--speed", "255", "--no-plot")


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("speed_value\n", "line 1: expected the columns"),
        ("speed_value,run_1_ms,run_2_ms\n0,5,5\n", "has 2 runs instead"),
    ],
)
def test_a_bad_table_is_refused(call: Call, text: str, words: str, tmp_path: Path) -> None:
    table = tmp_path / "t.csv"
    table.write_text(text, encoding="utf-8")
    call(*SPEEDS, "--output", str(table)).assert_failed(1, words)
    assert table.read_text(encoding="utf-8") == text


def test_fingers_that_meet_something_or_an_input_that_has_ended(call: Call, tmp_path: Path) -> None:
    gripper = SimulatedGripper(speedup=30)
    gripper.place_object(7, 150)
    with served(gripper) as server:
        for what, options, words in (
            ("speed", ("--yes", "--no-plot"), "the fingers met something"),
            ("force", IN_THE_WAY, "no answer: the input ended"),
        ):
            outcome = call("measure", what, server.address, "--output", str(tmp_path / "t.csv"), *options)
            assert outcome.code == 1
            assert words in outcome.err
            assert "t.csv" not in outcome.err, "there is no such file"
            assert not (tmp_path / "t.csv").exists()


@pytest.mark.usefixtures("virtually")
def test_the_scale_is_read_from_a_table(call: Call, tmp_path: Path) -> None:
    readings = tmp_path / "readings.csv"
    readings.write_text("force_value,run_1_g\n0,1111\n250,2222\n", encoding="utf-8")
    options = ("--output", str(tmp_path / "f.csv"), "--scale", str(readings), "--runs", "1")
    call(*FORCES, *options).assert_succeeded()
    assert read_table(tmp_path / "f.csv", FORCE) == {0: (1111,), 250: (2222,)}
    finer = ["125" if each == "250" else each for each in FORCES]
    outcome = call(*finer, "--output", str(tmp_path / "other.csv"), *options[2:])
    outcome.assert_failed(1, "has no 1 runs for the force values [125]")


@pytest.mark.usefixtures("virtually")
def test_a_table_of_other_settings_is_not_continued(call: Call, tmp_path: Path) -> None:
    table = ("--output", str(tmp_path / "t.csv"))
    call(*SPEEDS, *table).assert_succeeded()
    for options in (("10.255.255.1",), ("sim://", "--fingers", "A")):
        outcome = call("measure", "speed", *options, *table, "--step", "255", "--runs", "1", "--no-plot")
        outcome.assert_failed(1, "was measured with other settings")
    forces = (*FORCES, "--output", str(tmp_path / "f.csv"), "--runs", "1")
    call(*forces).assert_succeeded()
    outcome = call(*forces, "--surface", "rigid")
    outcome.assert_failed(1, "was measured with other settings: surface foam there and rigid here")


@pytest.mark.usefixtures("virtually")
def test_readings_without_their_currents_are_refused(call: Call, tmp_path: Path) -> None:
    currents = tmp_path / "t_currents.csv"
    options = ("--output", str(tmp_path / "t.csv"), "--runs", "2")
    call(*FORCES, *options).assert_succeeded()
    lines = currents.read_text(encoding="utf-8").splitlines(keepends=True)
    for left in (None, lines[:1], [line for line in lines if not line.startswith("0,2,")]):
        currents.unlink()
        if left is not None:
            currents.write_text("".join(left), encoding="utf-8")
        call(*FORCES, *options).assert_failed(1, "t_currents.csv")
        currents.touch()


@pytest.mark.usefixtures("virtually")
def test_a_file_that_cannot_be_written_is_one_line(call: Call, tmp_path: Path) -> None:
    name = str(tmp_path / ("x" * 300 + ".csv"))
    call(*SPEEDS, "--output", name).assert_failed(1, "File name too long")
    (tmp_path / "t.png").mkdir()
    table = tmp_path / "t.csv"
    outcome = call(*(each for each in SPEEDS if each != "--no-plot"), "--output", str(table))
    assert (outcome.code, "t.png" in outcome.err, "Traceback" in outcome.err) == (1, True, False)
    assert len(read_table(table, SPEED_LAYOUT)) == 2
