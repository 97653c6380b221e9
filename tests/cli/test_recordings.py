"""``robotiq-async record``, ``replay``, ``export``, ``plot`` and ``recover``."""

from __future__ import annotations

import csv
import itertools
import json
import os
import re
import signal
import time
from collections.abc import Callable
from datetime import UTC, datetime
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, Header
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from robotiq_async import RobotiqHand, State
from robotiq_async.cli.commands.recordings import TOPIC_KINDS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.recording.table import COLUMNS
from tests.grippers import until

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell

EXPORT = "export --convention COUNTS"


def rows_of(file: Path) -> list[dict[str, str]]:
    with file.open(encoding="utf-8", newline="") as stream:
        return list(csv.DictReader(stream))


def recorded(file: Path, topic: str) -> list[tuple[int, dict[str, object]]]:
    entries = [(each.nanoseconds, each.fields) for each in read_recording(file) if each.topic == topic]
    return sorted(entries, key=lambda pair: pair[0])


# -- record ------------------------------------------------------------------------------------------------


async def test_ctrl_c_ends_a_recording_that_is_whole_and_touches_nothing(
    shell: Shell, tmp_path: Path
) -> None:
    file = tmp_path / "it.mcap"
    gripper = SimulatedGripper(speedup=20)
    async with SimulatorServer(gripper) as server:
        process = await shell.start("record", str(file), server.address)
        assert await shell.read_line(process) == f"Gripper {server.address}"
        assert (await shell.read_line(process)).startswith("Recording ")
        await until(lambda: os.stat(file).st_size >= 3000)
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
        assert outcome.code == 0
        assert not gripper.writes
    assert " 0 lost, " in outcome.out
    sequences = [entry.sequence for entry in read_recording(file) if entry.topic == "/gripper/status"]
    assert sequences == list(range(sequences[0], sequences[-1] + 1))


def test_it_ends_by_itself_and_keeps_a_file_that_is_there(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    call("record", str(file), "--seconds", "0.5").assert_succeeded()
    assert len(list(read_recording(file))) > 20
    call("record", str(file), "--seconds", "0.5").assert_failed(1, "it.mcap: File exists")


def test_for_ros_2(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    outcome = call("record", "--ros2", "--seconds", "0.5", str(file))
    outcome.assert_succeeded()
    with AnyReader([file]) as reader:
        assert [connection.topic for connection in reader.connections] == ["/joint_states"]
        assert f"\n{reader.message_count} polls, 0 lost" in outcome.out
    for command in ("replay", "plot"):
        call(*command.split(), str(file)).assert_failed(1, "it.mcap: it contains no")


@pytest.mark.parametrize("option", [[], ["--csv"]])
def test_a_recording_named_csv_is_a_table_and_needs_no_mcap(
    call: Call, without: Callable[[str], None], option: list[str], there: SimulatorServer, tmp_path: Path
) -> None:
    without("mcap")
    table = tmp_path / "it.csv"
    outcome = call("record", str(table), "--seconds", "0.5", there.address, *option)
    outcome.assert_succeeded()
    rows = rows_of(table)
    assert f"{len(rows)} polls, 0 lost" in outcome.out
    assert rows[0]["state"] == "RESET"
    assert all(int(after["sequence"]) == int(before["sequence"]) + 1 for before, after in pairwise(rows))
    assert abs(datetime.fromisoformat(rows[-1]["time"]).timestamp() - time.time()) < 30
    assert not there.gripper.writes


async def test_a_recorder_makes_the_same_table(call: Call, tmp_path: Path) -> None:
    """The table equals an export of the same recording, except for the rows at which a state begins.

    It has all columns: a recorder does not know which will get a value.
    """
    table, file, exported = tmp_path / "it.csv", tmp_path / "it.mcap", tmp_path / "exported.csv"
    hand = RobotiqHand("sim://?speedup=20")
    async with Recorder(hand, table), Recorder(hand, file), hand:
        await hand.move(100)
    call("export", str(file), str(exported), "--convention", "COUNTS").assert_succeeded()
    for one, other in zip(rows_of(table), rows_of(exported), strict=True):
        for row in (one, other):
            del row["state"], row["time"]  # each recorder compares the clocks by itself
        assert one == dict.fromkeys(one, "") | other
    with pytest.raises(ValueError, match="ros2 is for MCAP files"):
        Recorder(hand, tmp_path / "joints.csv", ros2=True)


def test_no_gripper_no_file(call: Call, tmp_path: Path, refusing: str) -> None:
    call("record", str(tmp_path / "it.mcap"), refusing).assert_failed(1, "refused")
    assert not (tmp_path / "it.mcap").exists()


FULL = """
import resource, signal, sys
resource.setrlimit(resource.RLIMIT_FSIZE, (12_000, 12_000))
from robotiq_async.cli import main
sys.exit(main(["record", {!r}, {!r}]))
"""
"""A disk on which a file can have so many bytes: the last write is cut off in the middle."""


async def test_a_disk_that_is_full_is_one_line(shell: Shell, server: SimulatorServer, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    async with RobotiqHand(server.address) as hand:
        outcome = await shell.finish(await shell.forked("-c", FULL.format(str(file), server.address)))
        assert hand.state is State.RUNNING_IDLE
    outcome.assert_failed(1, "it.mcap: File too large")
    assert file.stat().st_size == 12_000
    there = [entry for entry in read_recording(file) if entry.topic == "/gripper/status"]
    counts = re.search(r"ended early: at least (\d+) of (\d+) polls are in the file; .*recover", outcome.out)
    assert counts is not None, outcome.out
    assert 0 < int(counts[1]) <= len(there) <= int(counts[2])
    assert "0 lost" not in outcome.out


# -- replay, export, plot, recover -------------------------------------------------------------------------


def test_replay_tells_the_story(grasp: Path, call: Call) -> None:
    story = [line.split(maxsplit=1)[1] for line in call("replay", str(grasp)).out.splitlines()]
    assert any("command  act=1 go=1 release=0 A=255@200/64" in line for line in story)
    assert any("CONTACT_CLOSING" in line for line in story)
    (fault,) = [n for n, line in enumerate(story) if line.startswith("fault    0x09 COMMUNICATION_NOT_READY")]
    assert story.index("state    FAULT -> RUNNING_IDLE (gripper is active)") > fault
    statuses = [line for line in story if line.startswith("status")]
    assert all(before != after for before, after in pairwise(statuses))


def test_in_brief_there_are_states_faults_and_contacts(grasp: Path, call: Call) -> None:
    *lines, last = call("replay", "--brief", str(grasp)).out.splitlines()
    assert {line.split()[1] for line in lines} == {"state", "contact", "fault"}
    assert not any("RUNNING_CC" in line for line in lines)
    contacts = [line.split(maxsplit=2)[2] for line in lines if " contact " in line]
    assert any(set("ABC") <= set(each) for each in contacts)
    assert any("fault    0x09" in line for line in lines)
    polls, commands = (len(recorded(grasp, f"/gripper/{each}")) for each in ("status", "command"))
    assert last.startswith(f"{polls} polls and {commands} commands in ")


def test_export_has_a_row_for_every_poll(grasp: Path, call: Call) -> None:
    table = grasp.with_suffix(".csv")
    outcome = call("export", str(grasp), "--convention", "counts")
    rows, polls = rows_of(table), recorded(grasp, "/gripper/status")
    assert outcome.out == f"{len(polls)} statuses in {table}\n"
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


JAW_LACKS = {name for name in COLUMNS["status"] if name.startswith(("B.", "C.", "SCISSOR."))}
FINGER_LACKS = {"label", "values", "contacts"}
"""Nothing is marked and nothing touched in the recordings below."""


@pytest.mark.parametrize(
    ("address", "lacks"),
    [
        ("sim://?", FINGER_LACKS),
        ("sim://?model=2f85&", FINGER_LACKS | JAW_LACKS),
        ("sim://?model=2f140&", FINGER_LACKS | JAW_LACKS),
        ("sim://?model=hand-e&", FINGER_LACKS | JAW_LACKS),
    ],
)
@pytest.mark.parametrize("kind", ["statuses", "commands", "events"])
async def test_a_column_without_a_value_is_left_out(
    address: str, lacks: set[str], kind: str, call: Call, tmp_path: Path
) -> None:
    file, table = tmp_path / "it.mcap", tmp_path / "it.csv"
    hand = RobotiqHand(f"{address}speedup=20")
    async with hand, Recorder(hand, file):
        await hand.move(60)
    convention = ["--convention", "COUNTS"] * (kind == "statuses")
    outcome = call("export", str(file), "--of", kind, *convention)
    outcome.assert_succeeded()
    rows = rows_of(table)
    columns = list(rows[0])
    assert [name for name in columns if not any(row[name] for row in rows)] == []
    left_out = [name for name in COLUMNS[TOPIC_KINDS[kind]] if name not in columns]
    words = f"Left out, without a value in any row: {', '.join(left_out)}\n"
    assert outcome.err == words * bool(left_out)
    assert columns == [name for name in COLUMNS[TOPIC_KINDS[kind]] if name not in left_out], "in their order"
    if kind == "statuses":
        assert set(left_out) == lacks


async def test_a_column_that_gets_its_first_value_late_is_kept(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    hand = RobotiqHand("sim://?model=2f85&speedup=20")
    async with hand, Recorder(hand, file) as recorder:
        await hand.move(60)
        recorder.mark("late", object="cup")
        await hand.move(90)
    call("export", str(file), "--convention", "COUNTS").assert_succeeded()
    rows = rows_of(file.with_suffix(".csv"))
    labels = [row["label"] for row in rows]
    assert labels == sorted(labels), "empty ones first"
    assert {"", "late"} == {*labels}
    assert [json.loads(row["values"]) for row in rows if row["values"]] == [{"object": "cup"}] * labels.count(
        "late"
    )


def test_a_value_that_only_the_last_row_has_is_kept(foreign: Callable[..., Path], call: Call) -> None:
    states = [event(kind="state", target="RESET")] * 300
    file = foreign(*states, event(kind="fault", fault="NONE", fault_code=0, description="0"))
    outcome = call("export", str(file), "--of", "events")
    rows = rows_of(file.with_suffix(".csv"))
    assert [row["fault_code"] for row in rows] == [""] * 300 + ["0"]
    assert rows[0].keys() == {"time", "kind", "timestamp", "target", "fault", "fault_code", "description"}
    assert "source" in outcome.err


def test_an_export_that_leaves_nothing_out_says_nothing(foreign: Callable[..., Path], call: Call) -> None:
    filled = dict.fromkeys(COLUMNS["event"][1:], "x") | {"values": {"a": 1}}
    outcome = call("export", str(foreign(json.dumps(filled).encode())), "--of", "events")
    outcome.assert_succeeded()
    assert outcome.err == ""


def test_export_in_the_numbers_of_a_learning_stack(grasp: Path, call: Call) -> None:
    """The name of the column has the sign: no reader guesses it."""
    table = grasp.with_name("stack.csv")
    call("export", str(grasp), str(table), "--convention", "droid").assert_succeeded()
    rows, polls = rows_of(table), recorded(grasp, "/gripper/status")
    for row, (_, fields) in zip(rows, polls, strict=True):
        shares: list[float] = [fields[finger]["open_fraction"] for finger in "ABC"]  # type: ignore[index]
        assert float(row["DROID"]) == pytest.approx(1 - sum(shares) / 3)
    assert rows[0].keys() - {"DROID"} == {*COLUMNS["status"]} - {"label", "values"}


def test_a_scale_that_export_does_not_know_and_one_without_an_opening_are_wrong_usage(
    grasp: Path, call: Call
) -> None:
    for arguments, words in (
        (("--convention", "ROBOMIMIC"), "(the gripper's own, 0 open .. 255 closed), DROID, RLDS"),
        ((), "got none: nobody should guess a sign"),
        (("--convention", "DROID", "--of", "events"), "events have no opening"),
    ):
        outcome = call("export", str(grasp), str(grasp.with_name("none.csv")), *arguments)
        assert outcome.code == 2
        assert words in outcome.err
    assert not grasp.with_name("none.csv").exists()


@pytest.mark.parametrize(("kind", "topic"), [("commands", "/gripper/command"), ("events", "/gripper/event")])
def test_commands_and_events_are_tables_too(grasp: Path, call: Call, kind: str, topic: str) -> None:
    table = grasp.with_name("it.csv")
    call("export", str(grasp), str(table), "--of", kind).assert_succeeded()
    rows = rows_of(table)
    for row, (_, fields) in zip(rows, recorded(grasp, topic), strict=True):
        assert float(row["timestamp"]) == fields["timestamp"]
    if kind == "commands":
        assert {row["A.speed"] for row in rows} >= {"200"}
    else:
        assert [row["fault"] for row in rows if row["kind"] == "fault"] == ["COMMUNICATION_NOT_READY", "NONE"]


def test_pandas_takes_it(grasp: Path, call: Call) -> None:
    pandas = pytest.importorskip("pandas")
    call("export", str(grasp), "--convention", "COUNTS").assert_succeeded()
    table = pandas.read_csv(grasp.with_suffix(".csv"), parse_dates=["time"], index_col="time")
    assert table.index.tz is not None
    assert abs(table.index[-1].timestamp() - time.time()) < 60
    assert table["A.position"].dtype.kind == "i"
    assert table["is_moving"].dtype.kind == "b"


@pytest.mark.usefixtures("undrawn")
def test_the_name_of_a_picture_may_have_its_suffix(grasp: Path, call: Call) -> None:
    call("plot", str(grasp), "--picture", str(grasp.with_name("there.png"))).assert_succeeded()
    assert grasp.with_name("there.png").exists()
    assert grasp.with_name("there.svg").exists()
    nowhere = str(grasp.parent / "nowhere" / "it")
    call("plot", str(grasp), "--picture", nowhere).assert_failed(1, "No such file or directory")


def test_recover_makes_a_broken_one_whole(grasp: Path, call: Call) -> None:
    whole = grasp.read_bytes()
    grasp.write_bytes(whole[: len(whole) // 2])
    out = call("recover", str(grasp)).out
    assert "was complete" not in out
    recovered = grasp.with_name("grasp.recovered.mcap")
    assert f"{len(list(read_recording(recovered)))} messages in {recovered}" in out
    call("recover", str(grasp)).assert_failed(1, "File exists")


@pytest.mark.usefixtures("undrawn")
def test_a_part_of_a_recording_is_drawn(grasp: Path, call: Call) -> None:
    outcome = call("plot", str(grasp), "--from", "0", "--to", "1e6")
    outcome.assert_succeeded()
    assert outcome.out.splitlines() == [str(grasp.with_suffix(suffix)) for suffix in (".png", ".svg")]
    picture = ("--picture", str(grasp.with_name("part")))
    call("plot", str(grasp), *picture, "--from", "1e6").assert_failed(1, "between --from and --to")
    call("plot", str(grasp), *picture, "--from", "2", "--to", "1").assert_failed(2, "less than --to")


@pytest.mark.usefixtures("undrawn")
def test_several_recordings_are_one_picture(grasp: Path, call: Call) -> None:
    other = grasp.with_name("other.mcap")
    other.write_bytes(grasp.read_bytes())
    outcome = call("plot", str(grasp), str(other), str(grasp))
    outcome.assert_succeeded()
    pictures = [str(grasp.with_name(f"{grasp.stem}+2{suffix}")) for suffix in (".png", ".svg")]
    assert outcome.out.splitlines() == pictures
    nothing = grasp.with_name("nothing.mcap")
    call("plot", str(grasp), str(nothing)).assert_failed(1, "nothing.mcap: No such file")
    with nothing.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        writer.finish()  # type: ignore[no-untyped-call]
    call("plot", str(grasp), str(nothing)).assert_failed(1, "nothing.mcap: it contains no status")
    for count in (0, 7):
        outcome = call("plot", *[str(grasp)] * count)
        outcome.assert_failed(2, f"name 1 to 6 recordings for a picture, got {count}")


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("command", ["replay", "plot"])
def test_of_a_broken_one_it_is_said_that_it_is(command: str, grasp: Path, call: Call) -> None:
    assert call(*command.split(), str(grasp)).err == ""
    whole = grasp.read_bytes()
    grasp.write_bytes(whole[: len(whole) * 2 // 3])
    outcome = call(*command.split(), str(grasp), "--overwrite")
    assert outcome.out
    outcome.assert_failed(0, "grasp.mcap ends too early, after ", "robotiq-async recover")


@pytest.mark.usefixtures("undrawn")
@pytest.mark.parametrize("command", ["plot", "replay --plot", EXPORT])
def test_an_existing_file_is_replaced_only_with_overwrite(command: str, grasp: Path, call: Call) -> None:
    there = grasp.with_suffix(".csv" if command == EXPORT else ".svg")
    there.write_text("mine")
    before = set(grasp.parent.iterdir())
    call(*command.split(), str(grasp)).assert_failed(1, f"{there}: File exists; --overwrite replaces it")
    assert there.read_text() == "mine"
    assert set(grasp.parent.iterdir()) == before, "not half of it either"
    outcome = call(*command.split(), str(grasp), "--overwrite")
    outcome.assert_succeeded()
    assert str(there) in outcome.out
    assert there.read_text(encoding="utf-8") != "mine"


# -- recordings of others ----------------------------------------------------------------------------------


def event(**fields: object) -> bytes:
    return json.dumps({"timestamp": 1.0, **fields}).encode()


STATE = event(kind="state", target="RESET")
STEERING = "\x1b[2J\x9b31m\x07\r\nroot# \u202e\ud800"
HOSTILE: dict[str, bytes] = {
    "a list": b"[]",
    "without what it is about": event(kind="transition"),
    "a code that is no number": event(kind="fault", fault_code="9", fault="N", description="D"),
}
AXIS = {"position": 6, "requested": 0, "current_ma": 0, "status": "AT_POSITION"}
OLD_STATUS = event(moving=False, **dict.fromkeys(("A", "B", "C", "SCISSOR"), AXIS))
OLD_FAULT = event(kind="fault", code=9, name="N", description="D")
"""Messages as they were recorded before."""
SHOWS = {
    "replay": ("/gripper/event", "/gripper/status", "/gripper/command"),
    "plot": ("/gripper/event", "/gripper/status"),
    EXPORT: ("/gripper/status",),
}
"""The topics that each command reads."""


@pytest.mark.parametrize("command", ["replay", "recover", "plot", EXPORT])
@pytest.mark.parametrize("content", [None, b"", b"no recording"])
def test_a_file_that_is_no_recording_gives_one_line_and_writes_nothing(
    command: str, content: bytes | None, tmp_path: Path, call: Call
) -> None:
    file = tmp_path / "it.mcap"
    if content is not None:
        file.write_bytes(content)
    words = "No such file" if content is None else "not an MCAP file"
    call(*command.split(), str(file)).assert_failed(1, words)
    assert [*tmp_path.iterdir()] == [file] * (content is not None)


@pytest.mark.parametrize("command", SHOWS)
def test_a_foreign_recording_is_refused_in_one_line_and_writes_nothing(
    foreign: Callable[..., Path], command: str, call: Call
) -> None:
    for topic, (what, data) in itertools.product(SHOWS[command], HOSTILE.items()):
        if command != "replay" and "code" in what:
            continue
        file = foreign(data, topic=topic)
        call(*command.split(), str(file)).assert_failed(1, f"foreign.mcap: a message on '{topic}' ")
        assert [*file.parent.iterdir()] == [file]


@pytest.mark.parametrize(
    ("command", "topic", "message", "lacks"),
    [
        ("replay", "status", OLD_STATUS, "axis_state"),
        ("plot", "status", OLD_STATUS, "requested_position"),
        ("replay", "event", OLD_FAULT, "fault_code"),
        ("plot", "event", OLD_FAULT, "fault"),
    ],
)
def test_a_recording_with_other_names_is_one_line_that_says_so(
    foreign: Callable[..., Path], command: str, topic: str, message: bytes, lacks: str, call: Call
) -> None:
    outcome = call(*command.split(), str(foreign(message, topic=f"/gripper/{topic}")))
    assert outcome.out == ""
    why = f"was not made by this version of robotiq_async: it has no '{lacks}'"
    outcome.assert_failed(1, f"{foreign()}: a message on '/gripper/{topic}' {why}\n")


@pytest.mark.parametrize("command", ["replay", "plot", "recover"])
def test_a_message_of_no_channel_is_one_line(foreign: Callable[..., Path], command: str, call: Call) -> None:
    call(*command.split(), str(foreign(STATE, channel=7))).assert_failed(
        1, "foreign.mcap: there is no channel 7"
    )


def test_control_characters_are_escaped(foreign: Callable[..., Path], call: Call) -> None:
    fault = event(kind="fault", fault_code=9, fault=STEERING, description=STEERING)
    outcome = call("replay", str(foreign(fault)))
    assert outcome.out.count("\n") == 1
    assert r"\x1b[2J\x9b31m\x07\r\nroot# \u202e\ud800" in outcome.out
    assert outcome.out.rstrip("\n").isprintable()
    assert outcome.err == ""


@pytest.mark.parametrize("command", ["replay", "plot", "recover"])
def test_an_error_does_not_steer_the_terminal_either(command: str, tmp_path: Path, call: Call) -> None:
    outcome = call(*command.split(), str(tmp_path / f"{STEERING}.mcap".replace("\ud800", "")))
    outcome.assert_failed(1, r"\x1b[2J")
    assert outcome.err.rstrip("\n").isprintable()


def test_words_of_others_are_no_formulas(foreign: Callable[..., Path], call: Call) -> None:
    words = '=HYPERLINK("http://192.0.2.1")\n,"'
    file = foreign(json.dumps({"kind": "state", "target": words}).encode())
    call("export", str(file), "--of", "events").assert_succeeded()
    [row] = rows_of(file.with_suffix(".csv"))
    assert row["target"] == f"'{words}"


@pytest.mark.parametrize(
    ("command", "words"),
    [
        ("replay", "it contains nothing for this command"),
        ("replay --brief", "it contains nothing for this command"),
        (EXPORT, "it contains no statuses"),
    ],
)
def test_nothing_to_show_is_said(foreign: Callable[..., Path], command: str, words: str, call: Call) -> None:
    file = foreign(b"{}", topic="/odometry")
    call(*command.split(), str(file)).assert_failed(1, f"foreign.mcap: {words}")
    assert not file.with_suffix(".csv").exists()


def test_a_plot_is_drawn_with_words_of_others_and_a_file_name_as_they_are(grasp: Path, call: Call) -> None:
    file = Path(os.fsdecode(os.fsencode(grasp.parent) + b"/\xff$\\frac{$.mcap"))
    channels: dict[str, int] = {}
    at = 0
    with grasp.open("rb") as own, file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for _, channel, message in make_reader(own).iter_messages():
            if channel.topic not in channels:
                channels[channel.topic] = writer.register_channel(channel.topic, "json", 0)
            at = message.log_time
            writer.add_message(channels[channel.topic], at, message.data, 0)
        for second, words in enumerate(("$\\frac{", "x" * 100_000, STEERING), 1):
            state = event(kind="state", target=words)
            writer.add_message(channels["/gripper/event"], at + second * 10**9, state, 0)
        writer.finish()  # type: ignore[no-untyped-call]
    outcome = call("plot", str(file))
    outcome.assert_succeeded()
    pictures = [file.with_suffix(suffix) for suffix in (".png", ".svg")]
    assert [line.rpartition(".")[2] for line in outcome.out.splitlines()] == ["png", "svg"]
    assert pictures[0].stat().st_size > 10_000
    drawn = pictures[1].read_bytes()
    assert b"COMMUNICATION_NOT_READY" in drawn
    assert drawn.count(b"<use ") > 50, "words are drawn as glyphs"
    assert "messages in" in call("recover", str(file)).out


LITTLE_MEMORY = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (1_500_000_000, 1_500_000_000))
from robotiq_async.cli import main
print(*(main([*command.split(), {!r}]) for command in ("replay", "recover", "export --convention COUNTS")))
"""
"""Runs commands with 1.5 GB of addresses."""


def zeros(count: int) -> bytes:
    """So many, as a frame of Zstandard (RFC 8878): blocks that say which byte is repeated how often."""
    blocks = count // 2**17
    heads = (2**17 << 3 | 1 << 1 | (block == blocks - 1) for block in range(blocks))
    return b"\x28\xb5\x2f\xfd\x00\x58" + b"".join(head.to_bytes(3, "little") + b"\0" for head in heads)


async def test_two_gigabytes_in_a_small_chunk_are_one_line(shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "bomb.mcap"
    data = zeros(2**31)
    builder = RecordBuilder()
    Header("", "").write(builder)
    Chunk("zstd", data, 0, 0, 0, 2**31).write(builder)
    file.write_bytes(b"\x89MCAP0\r\n" + builder.end())  # type: ignore[no-untyped-call]
    outcome = await shell.finish(await shell.forked("-c", LITTLE_MEMORY.format(str(file))))
    assert (outcome.code, outcome.out) == (0, "1 1 1\n"), outcome.err
    lines = outcome.err.splitlines()
    assert len(lines) == 3
    for line in lines:
        assert line.startswith("robotiq-async: ")
        assert "bomb.mcap: a chunk of 2147483648 bytes" in line
