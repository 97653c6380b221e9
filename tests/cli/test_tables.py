"""Recordings as tables, ``replay --brief``, and what is there already is not replaced."""

from __future__ import annotations

import csv
import json
import time
from collections.abc import Callable
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async import RobotiqHand
from robotiq_async.cli import main
from robotiq_async.simulator import SimulatorServer
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording

if TYPE_CHECKING:
    from tests.cli.conftest import Call


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def recorded(file: Path, topic: str) -> list[tuple[int, dict[str, object]]]:
    return sorted(
        ((each.nanoseconds, each.fields) for each in read_recording(file) if each.topic == topic),
        key=lambda pair: pair[0],
    )


# -- a table of a recording --------------------------------------------------------------------------------


def test_export_has_a_row_for_every_poll(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", str(grasp)]) == 0
    table = grasp.with_suffix(".csv")
    rows, polls = rows_of(table), recorded(grasp, "/gripper/status")
    assert capsys.readouterr().out == f"{len(polls)} statuses in {table}\n"
    assert len(rows) == len(polls)
    for row, (nanoseconds, fields) in zip(rows, polls, strict=True):
        assert int(row["sequence"]) == fields["sequence"]
        finger = fields["A"]
        assert isinstance(finger, dict)
        assert int(row["A.position"]) == finger["position"]
        assert row["A.axis_state"] == finger["axis_state"]
        assert row["fault"] == fields["fault"]
        at = datetime.fromisoformat(row["time"])
        assert at.tzinfo is UTC
        assert abs(at.timestamp() - nanoseconds / 1e9) < 2e-6
    assert {row["contacts"] for row in rows} >= {"", "A B C"}
    assert {row["state"] for row in rows} == {"RUNNING_IDLE", "RUNNING_CC", "FAULT"}
    assert len(rows[0]["registers"].split()) == 8


@pytest.mark.parametrize(("kind", "topic"), [("commands", "/gripper/command"), ("events", "/gripper/event")])
def test_commands_and_events_are_tables_too(grasp: Path, kind: str, topic: str) -> None:
    table = grasp.with_name("it.csv")
    assert main(["export", str(grasp), str(table), "--of", kind]) == 0
    rows, messages = rows_of(table), recorded(grasp, topic)
    assert len(rows) == len(messages)
    for row, (_, fields) in zip(rows, messages, strict=True):
        assert float(row["timestamp"]) == fields["timestamp"]
    if kind == "commands":
        assert {row["A.speed"] for row in rows} >= {"200"}
    else:
        assert [row["fault"] for row in rows if row["kind"] == "fault"] == ["COMMUNICATION_NOT_READY", "NONE"]


def test_pandas_takes_it(grasp: Path) -> None:
    pandas = pytest.importorskip("pandas")
    assert main(["export", str(grasp)]) == 0
    table = pandas.read_csv(grasp.with_suffix(".csv"), parse_dates=["time"], index_col="time")
    assert table.index.tz is not None
    assert abs(table.index[-1].timestamp() - time.time()) < 60
    assert table["A.position"].dtype.kind == "i"
    assert table["is_moving"].dtype.kind == "b"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["grasp.mcap", "out.txt"], "must be a file named .csv, got out.txt"),
        (["grasp.csv"], "grasp.csv is the table itself"),
        (["grasp.mcap", "--of", "everything"], "everything"),
    ],
)
def test_wrong_usage(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["export", *arguments]) == 2
    assert words in capsys.readouterr().err


def test_words_of_others_are_no_formulas(foreign: Callable[..., Path]) -> None:
    words = '=HYPERLINK("http://192.0.2.1")\n,"'
    file = foreign(json.dumps({"kind": "state", "target": words}).encode())
    assert main(["export", str(file), "--of", "events"]) == 0
    [row] = rows_of(file.with_suffix(".csv"))
    assert row["target"] == f"'{words}"


def test_a_recording_without_statuses_says_so(
    foreign: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    file = foreign(b'{"kind": "state", "target": "RESET"}')
    assert main(["export", str(file)]) == 1
    assert "it contains no statuses" in capsys.readouterr().err
    assert not file.with_suffix(".csv").exists()


# -- recorded as a table -----------------------------------------------------------------------------------


@pytest.mark.parametrize("option", [[], ["--csv"]])
def test_a_recording_named_csv_is_a_table(
    call: Call, option: list[str], there: SimulatorServer, tmp_path: Path
) -> None:
    table = tmp_path / "it.csv"
    outcome = call("record", str(table), "--seconds", "0.5", there.address, *option)
    outcome.assert_succeeded()
    rows = rows_of(table)
    assert f"{len(rows)} polls, 0 lost" in outcome.out
    assert rows[0]["state"] == "RESET"
    assert [int(row["sequence"]) for row in rows] == list(
        range(int(rows[0]["sequence"]), int(rows[-1]["sequence"]) + 1)
    )
    assert abs(datetime.fromisoformat(rows[-1]["time"]).timestamp() - time.time()) < 30
    assert not there.gripper.writes


def test_a_table_needs_no_mcap(
    call: Call, without: Callable[[str], None], there: SimulatorServer, tmp_path: Path
) -> None:
    without("mcap")
    call("record", str(tmp_path / "it.csv"), "--seconds", "0.1", there.address).assert_succeeded()
    outcome = call("record", str(tmp_path / "it.mcap"), there.address)
    outcome.assert_failed(1, "pip install", "mcap", "or record a table, .csv")


def test_a_table_that_is_there_is_kept(call: Call, there: SimulatorServer, tmp_path: Path) -> None:
    table = tmp_path / "it.csv"
    table.write_text("mine")
    call("record", str(table), "--seconds", "1", there.address).assert_failed(1, "File exists")
    assert table.read_text() == "mine"


@pytest.mark.parametrize(
    ("arguments", "words"),
    [
        (["it.mcap", "--csv"], "name the file .csv"),
        (["it.csv", "--ros2"], "--ros2 records an MCAP file"),
    ],
)
def test_what_excludes_a_table(arguments: list[str], words: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", *arguments]) == 2
    assert words in capsys.readouterr().err


async def test_a_recorder_makes_the_same_table(tmp_path: Path) -> None:
    """As an export of what was recorded at the same time; but for where a state begins."""
    table, file = tmp_path / "it.csv", tmp_path / "it.mcap"
    hand = RobotiqHand("sim://?speedup=20")
    async with Recorder(hand, table), Recorder(hand, file), hand:
        await hand.move(100)
    assert main(["export", str(file), str(tmp_path / "exported.csv")]) == 0
    ours, exported = rows_of(table), rows_of(tmp_path / "exported.csv")
    assert len(ours) == len(exported)
    for one, other in zip(ours, exported, strict=True):
        for row in (one, other):
            del row["state"], row["time"]  # each recorder compares the clocks by itself
        assert one == other
    with pytest.raises(ValueError, match="ros2 is for MCAP files"):
        Recorder(hand, tmp_path / "joints.csv", ros2=True)


# -- in brief ----------------------------------------------------------------------------------------------


def test_in_brief_there_are_states_faults_and_contacts(
    grasp: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", "--brief", str(grasp)]) == 0
    lines = capsys.readouterr().out.splitlines()
    kinds = [line.split()[1] for line in lines[:-1]]
    assert set(kinds) == {"state", "contact", "fault"}
    assert not any("RUNNING_CC" in line for line in lines)
    contacts = [line.split(maxsplit=2)[2] for line in lines if " contact " in line]
    assert any(set("ABC") <= set(each) for each in contacts)
    assert any("fault    0x09" in line for line in lines)
    polls, commands = (len(recorded(grasp, f"/gripper/{each}")) for each in ("status", "command"))
    assert lines[-1].startswith(f"{polls} polls and {commands} commands in ")


# -- what is there already ---------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [["plot"], ["replay", "--plot"], ["export"]])
def test_what_is_there_is_replaced_only_if_that_is_said(
    command: list[str], grasp: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = grasp.with_suffix(".csv" if command == ["export"] else ".svg")
    there.write_text("mine")
    before = set(grasp.parent.iterdir())
    assert main([*command, str(grasp)]) == 1
    assert capsys.readouterr().err == f"robotiq-async: {there}: File exists; --overwrite replaces it\n"
    assert there.read_text() == "mine"
    assert set(grasp.parent.iterdir()) == before, "not half of it either"
    assert main([*command, str(grasp), "--overwrite"]) == 0
    assert there.read_text(encoding="utf-8") != "mine"
