"""Recordings: nothing is lost, others can read them, and a killed one is made whole."""

from __future__ import annotations

import asyncio
import csv
import errno
import gc
import io
import json
import logging
import os
import signal
import sys
import threading
import time
from asyncio.subprocess import PIPE
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from mcap.reader import make_reader
from rosbags.highlevel import AnyReader
from rosbags.typesys import Stores, get_typestore

from robotiq_async import Finger, RobotiqHand, RobotiqStatus, State, sync
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.description.joint_states import SCHEMA_NAME, JointStateEncoder
from robotiq_async.tools.description.kinematics import JOINTS, joint_angles
from robotiq_async.tools.errors import RecordingError
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import RecordedMessage, read_recording, recover
from robotiq_async.tools.recording.table import export
from tests.forks import in_the_child
from tests.grippers import until
from tests.patience import patience

ROOT = Path(__file__).parents[2]


@pytest.fixture
def file(tmp_path: Path) -> Path:
    return tmp_path / "it.mcap"


def statuses(file: Path) -> list[dict[str, Any]]:
    return [entry.fields for entry in read_recording(file) if entry.topic == "/gripper/status"]


def table(file: Path) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(file.read_text())))


# -- what is in it -----------------------------------------------------------------------------------------


async def test_every_poll_is_recorded(hand: RobotiqHand, file: Path) -> None:
    async with Recorder(hand, file) as recorder:
        first = hand.status.sequence
        await hand.move(50)
        await hand.move(0)
        last = hand.status.sequence
    polls = {fields["sequence"]: fields for fields in statuses(file)}
    assert list(polls) == list(range(min(polls), max(polls) + 1))
    assert min(polls) <= first + 1
    assert max(polls) >= last
    assert (recorder.recorded, recorder.missed) == (len(polls), 0)
    joints = [entry for entry in read_recording(file) if entry.topic == "/joint_states"]
    assert [entry.sequence for entry in joints] == list(polls)
    for entry in joints:
        message: Any = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(entry.data, SCHEMA_NAME)
        poll = polls[entry.sequence]
        status = RobotiqStatus.from_registers(poll["registers"], timestamp=0.0, sequence=0)
        assert list(message.position) == list(joint_angles(status))


async def test_commands_transitions_and_faults(
    hand: RobotiqHand, gripper: SimulatedGripper, file: Path
) -> None:
    async with Recorder(hand, file):
        await hand.set_speed(77, Finger.B)
        await hand.move(120, Finger.A)
        gripper.inject_fault(9)
        await hand.wait_for_state(State.FAULT)
        gripper.clear_faults()
        await hand.wait_for_state(State.RUNNING_IDLE)
    entries = list(read_recording(file))
    commands = [entry.fields for entry in entries if entry.topic == "/gripper/command"]
    assert commands[0]["B"]["speed"] == 77
    assert any(command["A"]["position"] == 120 and command["go"] for command in commands)
    assert all(command["acknowledged"] for command in commands)
    assert [tuple(command["registers"]) for command in commands] == [
        write.registers for write in list(gripper.writes)[-len(commands) :]
    ]
    for topic in ("/gripper/command", "/gripper/event"):
        sequences = [entry.sequence for entry in entries if entry.topic == topic]
        assert sequences == list(range(1, len(sequences) + 1))
    events = [entry.fields for entry in entries if entry.topic == "/gripper/event"]
    faults = [event["fault_code"] for event in events if event["kind"] == "fault"]
    assert faults == [9, 0]
    moves = [(event["source"], event["target"]) for event in events if event["kind"] == "transition"]
    assert ("RUNNING_IDLE", "FAULT") in moves
    assert ("FAULT", "RUNNING_IDLE") in moves
    assert all(before[1] == after[0] for before, after in pairwise(moves))


async def test_an_event_has_the_time_of_what_it_tells(
    hand: RobotiqHand, gripper: SimulatedGripper, file: Path
) -> None:
    """A fault that of the status with it, a transition its own: it follows within microseconds."""
    transitions = hand.transitions()
    async with Recorder(hand, file):
        gripper.inject_fault(9)
        await hand.wait_for_state(State.FAULT)
    entries = [entry for entry in read_recording(file) if entry.is_json]
    offsets = {entry.nanoseconds - round(entry.fields["timestamp"] * 1e9) for entry in entries}
    assert max(offsets) - min(offsets) < 1000, "nanoseconds: all go by one clock"
    times = {entry.fields["timestamp"] for entry in entries if entry.fields.get("kind") == "transition"}
    assert {each.timestamp for each in transitions.drain()} == times
    (fault,) = [entry.fields for entry in entries if entry.fields.get("kind") == "fault"]
    shown = next(entry.fields for entry in entries if entry.fields.get("fault_code") == 9)
    assert fault["timestamp"] == shown["timestamp"]


async def test_marks_are_events_and_label_what_comes_after_them(hand: RobotiqHand, tmp_path: Path) -> None:
    mcap, csv_file, exported = (tmp_path / name for name in ("it.mcap", "it.csv", "exported.csv"))
    async with Recorder(hand, mcap) as one, Recorder(hand, csv_file) as other:
        for recorder in (one, other):
            recorder.mark("grasp 1", object="cup", weight=0.25, wet=False)
        await hand.move(60)
        position = hand.status.position(Finger.A)
        for recorder in (one, other):
            recorder.mark("grasp 2")
        await hand.move(0)
        for recorder in (one, other):
            recorder.mark("")
        await hand.move(10)
    events = [entry.fields for entry in read_recording(mcap) if entry.topic == "/gripper/event"]
    marks = [each for each in events if each["kind"] == "mark"]
    assert [(each["label"], each["values"]) for each in marks] == [
        ("grasp 1", {"object": "cup", "weight": 0.25, "wet": False}),
        ("grasp 2", {}),
        ("", {}),
    ]
    assert export(read_recording(mcap), "status", exported, None).rows
    for file in (csv_file, exported):
        rows = table(file)
        labels = [row["label"] for row in rows]
        assert [label for label, _ in groupby(labels)][-3:] == ["grasp 1", "grasp 2", ""]
        at = [int(row["A.position"]) for row in rows if row["label"] == "grasp 1"]
        assert (at[0], at[-1]) == (6, position)
        assert {row["label"]: row["values"] and json.loads(row["values"]) for row in rows} == {
            "grasp 1": {"object": "cup", "weight": 0.25, "wet": False},
            "grasp 2": "",
            "": "",
        }, "a table has nowhere else for them"
    assert export(read_recording(mcap), "event", exported, None).rows
    row = next(each for each in table(exported) if each["label"] == "grasp 1")
    assert json.loads(row["values"]) == {"object": "cup", "weight": 0.25, "wet": False}


async def test_a_mark_needs_a_recording_with_events_and_plain_values(
    hand: RobotiqHand, tmp_path: Path
) -> None:
    recorder = Recorder(hand, tmp_path / "it.csv")
    with pytest.raises(RecordingError, match="async with"):
        recorder.mark("early")
    async with recorder:
        with pytest.raises(TypeError, match="label"):
            recorder.mark(7)  # type: ignore[arg-type]
        with pytest.raises(TypeError, match=r"object must be a str, int, float or bool, got \[\]"):
            recorder.mark("grasp", object=[])  # type: ignore[arg-type]
        with pytest.raises(ValueError, match="weight must be finite, got nan"):
            recorder.mark("grasp", weight=float("nan"))
        with pytest.raises(ValueError, match="serial must have 64 bits or fewer, got "):
            recorder.mark("grasp", serial=10**5000)
    with pytest.raises(RecordingError, match="async with"):
        recorder.mark("late")
    async with Recorder(hand, tmp_path / "it.mcap", ros2=True) as joints:
        with pytest.raises(RecordingError, match="joint states only"):
            joints.mark("grasp")


@pytest.mark.parametrize("made", ["it.csv", "it.mcap"])
async def test_a_name_that_is_not_utf_8_does_not_end_a_recording(
    made: str, hand: RobotiqHand, tmp_path: Path
) -> None:
    """A table ended at the next row, and an export with a traceback."""
    name = os.fsdecode(b"part \xff")
    async with Recorder(hand, tmp_path / made) as recorder:
        with pytest.raises(ValueError, match=r"label must be text without surrogates, got 'part \\udcff'"):
            recorder.mark(name)
        with pytest.raises(ValueError, match="file must be text without surrogates"):
            recorder.mark("grasp", file=name)
        recorder.mark("Tässä \N{WATCH}")
        await hand.move(60)
    assert recorder.saved == recorder.recorded > 0


async def test_values_that_numpy_made_are_taken_and_none_left_out(hand: RobotiqHand, file: Path) -> None:
    async with Recorder(hand, file) as recorder:
        given = {"weight": np.float32(0.25), "count": np.int64(3), "wet": np.bool_(0), "part": np.str_("cup")}
        given["width"] = (await hand.grasp()).width_mm  # of no part
        recorder.mark("grasp", **given)  # type: ignore[arg-type]  # numpy's are no subclasses
        with pytest.raises(TypeError, match="all must be a str, int, float or bool"):
            recorder.mark("grasp", all=np.zeros(3))  # type: ignore[arg-type]
    (mark,) = [each.fields for each in read_recording(file) if each.is_json and "values" in each.fields]
    assert mark["values"] == {"weight": 0.25, "count": 3, "wet": False, "part": "cup"}


def test_text_that_utf_8_does_not_have_is_exported_all_the_same(tmp_path: Path) -> None:
    foreign = RecordedMessage(
        "/gripper/event", 0, 1, b'{"kind": "mark", "label": "part \\udcff", "values": {}}', is_json=True
    )
    assert export([foreign], "event", tmp_path / "it.csv", None).rows == 1
    assert table(tmp_path / "it.csv")[0]["label"] == "part \\udcff"


async def test_it_tells_which_hand_it_is_of(file: Path) -> None:
    hand = RobotiqHand(name="left")
    async with Recorder(hand, file):
        pass
    with file.open("rb") as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    assert (metadata.metadata["name"], metadata.metadata["address"]) == ("left", hand.address)


async def test_an_mcap_reader_of_others_reads_it(hand: RobotiqHand, file: Path) -> None:
    async with Recorder(hand, file):
        await hand.move(100)
    with file.open("rb") as stream:
        reader = make_reader(stream)
        summary = reader.get_summary()
        assert summary is not None
        topics = {channel.topic: channel for channel in summary.channels.values()}
        gripper, ros = {"status", "command", "event"}, {"/joint_states", "/robot_description", "/tf"}
        assert topics.keys() == {f"/gripper/{name}" for name in gripper} | ros
        encodings = {summary.schemas[each.schema_id].encoding for each in topics.values()}
        assert encodings == {"jsonschema", "ros2msg"}
        stamps = []
        for schema, _, message in reader.iter_messages(topics=["/gripper/status"]):
            assert schema is not None
            wanted = json.loads(schema.data)["properties"]
            assert set(json.loads(message.data)) == set(wanted)
            stamps.append(message.log_time)
        assert stamps == sorted(stamps)
        assert abs(stamps[-1] / 1e9 - os.stat(file).st_mtime) < 10


@pytest.fixture(params=["whole", "killed"])
async def of_ros(
    request: pytest.FixtureRequest, hand: RobotiqHand, file: Path, tmp_path: Path
) -> tuple[Path, Recorder]:
    """A recording for ROS 2, as it was made or as recover made it of what a kill left."""
    async with Recorder(hand, file, ros2=True) as recorder:
        await hand.move(180, speed=0)  # long enough for many polls, however late they are
    if request.param == "whole":
        return file, recorder
    file.write_bytes(file.read_bytes()[:-100])  # noqa: ASYNC240  # short
    recovered = tmp_path / "recovered.mcap"
    recover(file, recovered)
    return recovered, recorder


async def test_rosbags_opens_a_recording_for_ros_2(of_ros: tuple[Path, Recorder]) -> None:
    file, recorder = of_ros
    with AnyReader([file]) as reader:
        (connection,) = reader.connections
        assert (connection.topic, connection.msgtype) == ("/joint_states", SCHEMA_NAME)
        assert reader.message_count == recorder.recorded > 10
        times, angles, velocities = [], set(), set()
        for each, nanoseconds, data in reader.messages():
            message: Any = reader.deserialize(data, each.msgtype)
            assert message.name == list(JOINTS)
            stamp = message.header.stamp
            assert stamp.sec * 10**9 + stamp.nanosec == nanoseconds
            times.append(nanoseconds)
            angles.add(tuple(message.position))
            velocities.add(tuple(message.velocity))
            assert len(message.effort) == 11
    assert times == sorted(times)
    assert len(angles) > 5
    assert len(velocities) > 5


@pytest.mark.parametrize("frame", ["", "a", "palm", "the hand's own frame"])
def test_frames_of_any_length_leave_the_numbers_aligned(frame: str) -> None:
    numbers = [[float(10 * row + at) for at in range(11)] for row in range(3)]
    data = JointStateEncoder(frame).encode(1_700_000_000_123_456_789, *numbers)
    message: Any = get_typestore(Stores.ROS2_JAZZY).deserialize_cdr(data, SCHEMA_NAME)
    assert message.header.frame_id == frame
    assert [list(message.position), list(message.velocity), list(message.effort)] == numbers


# -- of a blocking hand ------------------------------------------------------------------------------------


def test_a_blocking_hand_is_recorded_from_its_start_to_its_stop(file: Path) -> None:
    hand = sync.RobotiqHand("sim://?speedup=20")
    with Recorder(hand, file) as recorder, hand:
        recorder.mark("grasp 7", object="cup")
        hand.close(Finger.A, speed=255)
        last = hand.status.sequence
    polls = [fields["sequence"] for fields in statuses(file)]
    assert polls == list(range(polls[0], polls[-1] + 1))
    assert polls[-1] >= last
    assert (recorder.recorded, recorder.missed) == (len(polls), 0)
    events = [entry.fields for entry in read_recording(file) if entry.topic == "/gripper/event"]
    assert ("grasp 7", {"object": "cup"}) in [(each.get("label"), each.get("values")) for each in events]
    assert [each["target"] for each in events if each["kind"] == "transition"][-1] == "SHUTDOWN"
    with pytest.raises(RecordingError, match="not recording"):
        recorder.mark("too late")


def test_a_recording_of_a_blocking_hand_that_fails_says_so(tmp_path: Path) -> None:
    file = tmp_path / "polls.csv"
    file.touch()
    hand = sync.RobotiqHand("sim://?speedup=20")
    with pytest.raises(RecordingError, match="File exists"), Recorder(hand, file), hand:
        pass
    assert hand.state is not State.RUNNING_IDLE
    file.unlink()
    recorder = Recorder(hand, file)
    with pytest.raises(ValueError, match="finite"), recorder, hand:
        recorder.mark("grasp", width=float("nan"))
    assert len(table(file)) == recorder.recorded > 0, "the rest is written, and the error is not replaced"


# -- what can go wrong -------------------------------------------------------------------------------------


async def test_the_other_with_is_refused_before_a_file_is_made(file: Path) -> None:
    with pytest.raises(TypeError, match="a blocking hand is recorded with 'with'"):
        async with Recorder(sync.RobotiqHand("sim://"), file):
            pass
    with (
        pytest.raises(TypeError, match="a hand for asyncio is recorded with 'async with'"),
        Recorder(RobotiqHand("sim://"), file),
    ):
        pass
    with pytest.raises(TypeError, match="hand must be a hand, got 'sim://'"):
        Recorder("sim://", file)  # type: ignore[arg-type]
    assert not file.exists()  # noqa: ASYNC240  # short


async def test_a_file_that_is_there_is_not_overwritten(hand: RobotiqHand, file: Path) -> None:
    file.write_bytes(b"precious")  # noqa: ASYNC240  # short
    with pytest.raises(RecordingError, match=r"it\.mcap: File exists"):
        async with Recorder(hand, file):
            pass
    assert os.stat(file).st_size == len(b"precious")
    with pytest.raises(RecordingError, match="No such file"):
        async with Recorder(hand, file.parent / "nowhere" / "it.mcap"):
            pass


class FullDisk(Recorder):
    """A disk that is full after some bytes."""

    room = 20_000

    def _write(self, data: bytes) -> None:
        self.room -= len(data)
        if self.room < 0:
            raise OSError(errno.ENOSPC, "No space left on device")
        super()._write(data)


async def test_a_full_disk_ends_the_recording_and_nothing_else(
    hand: RobotiqHand, gripper: SimulatedGripper, file: Path, caplog: pytest.LogCaptureFixture
) -> None:
    recorder = FullDisk(hand, file)
    with pytest.raises(RecordingError, match=r"it\.mcap: No space left on device"):  # noqa: PT012
        async with recorder:
            writes = len(gripper.writes)
            with pytest.raises(TimeoutError):  # it continues when this waiting ends
                await asyncio.wait_for(recorder.failure(), 0.01)
            async with asyncio.timeout(patience(20)):
                failure = await recorder.failure()
            assert "No space left" in str(failure)
            assert "the recording has ended, the hand runs: " in caplog.text, "at once, and not in an hour"
            assert hand.state is State.RUNNING_IDLE
            assert len(gripper.writes) == writes
            await hand.move(50)
    assert recorder.has_failed
    assert 0 < recorder.saved == len(statuses(file)) <= recorder.recorded
    with pytest.raises(ZeroDivisionError):  # noqa: PT012  # an exception of the block is not hidden
        async with FullDisk(hand, file.with_name("other.mcap")) as other:
            other.room = 0
            await other.failure()
            raise ZeroDivisionError


async def test_a_recording_outlasts_a_want_of_threads(
    hand: RobotiqHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, caplog: pytest.LogCaptureFixture
) -> None:
    """Nothing more was saved, and has_failed was false."""

    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    caplog.set_level(logging.WARNING)  # the watch for complaints of the loop keeps errors only
    async with Recorder(hand, tmp_path / "it.csv") as recorder:
        await until(lambda: recorder.saved > 0)
        with monkeypatch.context() as patch:
            patch.setattr(threading.Thread, "start", start)
            await until(lambda: "waits for a thread" in caplog.text)  # a save that had begun has ended
            before, recorded = recorder.saved, recorder.recorded
            await until(lambda: recorder.recorded > recorded)
            assert recorder.saved == before
            assert not recorder.has_failed
        await until(lambda: recorder.saved > before)
    assert len((tmp_path / "it.csv").read_text(encoding="utf-8").splitlines()) > recorded
    assert caplog.text.count("waits for a thread") == 1


async def test_a_recording_that_never_gets_a_thread_has_failed(
    hand: RobotiqHand, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    def start(_: threading.Thread) -> None:
        raise RuntimeError("can't start new thread")

    async def record() -> None:
        recorder = Recorder(hand, tmp_path / "it.csv")
        try:
            async with recorder:
                await until(lambda: recorder.saved > 0)
                monkeypatch.setattr(threading.Thread, "start", start)
                await until(lambda: recorder.recorded > recorder.saved + 10)
        finally:
            assert recorder.has_failed

    with pytest.raises(RecordingError, match="can't start new thread"):
        await record()
    gc.collect()  # a file that was left open is a ResourceWarning here, and not in a later test


class JumpingLoop(asyncio.SelectorEventLoop):
    """Its clock can jump, as if something had held it up; other threads are not held up."""

    jumped = 0.0

    def time(self) -> float:
        return super().time() + self.jumped

    def hold_up_after(self, turns: int, seconds: float) -> None:
        if turns:
            self.call_soon(self.hold_up_after, turns - 1, seconds)
        else:
            self.jumped += seconds


@pytest.mark.parametrize("turns", [1, 6, 9, 12])
def test_a_loop_that_is_held_up_at_the_end_is_no_disk_that_does_not_answer(
    tmp_path: Path, turns: int
) -> None:
    """The disk had long answered, and the recording was given up: its file had no end."""

    async def record() -> Recorder:
        loop = asyncio.get_running_loop()
        assert isinstance(loop, JumpingLoop)
        async with RobotiqHand("sim://?speedup=20") as hand, Recorder(hand, tmp_path / "it.csv") as recorder:
            await hand.move(100)
            loop.hold_up_after(turns, 11.0)
        return recorder

    with asyncio.Runner(loop_factory=JumpingLoop) as runner:
        recorder = runner.run(record())
    assert not recorder.has_failed
    assert recorder.saved == recorder.recorded > 0


async def test_a_file_that_is_deleted_meanwhile_is_a_failure(hand: RobotiqHand, file: Path) -> None:
    with pytest.raises(RecordingError, match="deleted"):  # noqa: PT012
        async with Recorder(hand, file) as recorder:
            await asyncio.to_thread(file.unlink)
            async with asyncio.timeout(patience(20)):
                await recorder.failure()
    assert recorder.saved == 0


async def test_threads_that_are_all_busy_do_not_hold_it_up(hand: RobotiqHand, file: Path) -> None:
    release = threading.Event()
    busy = [asyncio.ensure_future(asyncio.to_thread(release.wait)) for _ in range(64)]
    async with Recorder(hand, file):
        await until(lambda: os.stat(file).st_size >= 5000)
    assert statuses(file)
    release.set()
    await asyncio.gather(*busy)


@pytest.mark.parametrize("steps", range(14))
async def test_cancelled_at_any_moment_the_file_is_whole_or_not_there(
    hand: RobotiqHand, file: Path, steps: int
) -> None:
    entered = asyncio.Event()

    async def use() -> None:
        async with Recorder(hand, file):
            entered.set()
            await asyncio.Event().wait()

    using = asyncio.create_task(use())
    if steps >= 7:
        await entered.wait()
    for _ in range(steps % 7):
        await asyncio.sleep(0)
    using.cancel()
    for _ in range(steps % 5):
        await asyncio.sleep(0)
        using.cancel()
    await asyncio.gather(using, return_exceptions=True)
    if file.exists():  # noqa: ASYNC240  # short
        with file.open("rb") as stream:
            assert make_reader(stream).get_summary() is not None


async def test_a_hand_that_is_started_again_is_recorded_again(gripper: SimulatedGripper, file: Path) -> None:
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address)
        async with Recorder(hand, file) as recorder:
            for _ in range(2):
                async with hand:
                    await hand.move(100)
                    await hand.move(0)
        assert recorder.missed == 0
    entries = list(read_recording(file))
    states = [entry.fields["target"] for entry in entries if entry.topic == "/gripper/event"]
    assert states[0] == "DISCONNECTED", "the state it began in"
    assert states.count("SHUTDOWN") == 2, "around the hand it sees both stops"
    last = [entry.fields for entry in entries if entry.topic == "/gripper/command"][-1]
    assert (last["go"], last["acknowledged"]) == (False, True)
    sequences = [fields["sequence"] for fields in statuses(file)]
    assert sequences == list(range(sequences[0], sequences[-1] + 1))


async def test_a_killed_recording_loses_less_than_a_second_and_is_made_whole(
    file: Path, tmp_path: Path
) -> None:
    program = f"""
import asyncio
from robotiq_async import RobotiqHand
from robotiq_async.tools.recording.recorder import Recorder

async def main():
    hand = RobotiqHand()
    await hand.start(activate=False)
    async with Recorder(hand, {str(file)!r}):
        async for status in hand.statuses():
            print(status.sequence, flush=True)

asyncio.run(main())
"""
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", program, stdout=PIPE, cwd=ROOT)
    assert process.stdout is not None
    last = 0
    async with asyncio.timeout(patience(60)):
        while last < 400:
            last = int(await process.stdout.readline())
    process.send_signal(signal.SIGKILL)
    rest, _ = await process.communicate()
    last = int(rest.split()[-1]) if rest.split() else last
    with pytest.raises(Exception, match=r".*"), file.open("rb") as stream:
        make_reader(stream).get_summary()
    kept = [fields["sequence"] for fields in statuses(file)]
    assert kept == list(range(kept[0], kept[-1] + 1))
    assert last - kept[-1] < 200
    whole = tmp_path / "whole.mcap"
    found = recover(file, whole)
    assert not found.is_whole
    assert [fields["sequence"] for fields in statuses(whole)] == kept
    assert list(read_recording(whole)) == list(read_recording(file))
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        assert summary is not None
        assert summary.statistics is not None
        assert summary.statistics.message_count == found.messages


async def test_recovering_what_is_whole_changes_nothing(
    hand: RobotiqHand, file: Path, tmp_path: Path
) -> None:
    async with Recorder(hand, file):
        await hand.move(30)
    found = recover(file, tmp_path / "again.mcap")
    assert found.is_whole
    assert list(read_recording(tmp_path / "again.mcap")) == list(read_recording(file))
    with pytest.raises(RecordingError, match="File exists"):
        recover(file, tmp_path / "again.mcap")


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork here")
def test_a_recorder_stays_with_the_process_that_began_it(file: Path) -> None:
    """Marks that were made in a child went nowhere, and nothing said so."""
    hand = sync.RobotiqHand("sim://?speedup=50")
    with Recorder(hand, file) as recorder, hand:

        def check() -> None:
            with pytest.raises(RuntimeError, match="stays with the parent"):
                recorder.mark("grasp 1")
            with pytest.raises(RuntimeError, match="stays with the parent"):
                recorder.__exit__(None, None, None)

        assert in_the_child(check) == 0
        recorder.mark("grasp 1")


async def test_a_wall_clock_that_steps_back_moves_nothing_within_a_recording(
    hand: RobotiqHand, file: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    async with Recorder(hand, file):
        await hand.move(60)
        monkeypatch.setattr(time, "time", lambda at=time.time: at() - 3600)
        await hand.move(0)
    entries = [entry for entry in read_recording(file) if entry.is_json]
    offsets = [entry.nanoseconds - round(entry.fields["timestamp"] * 1e9) for entry in entries]
    assert max(offsets) - min(offsets) < 1000, "nanoseconds"
