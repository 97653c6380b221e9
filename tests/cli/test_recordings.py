"""``robotiq-async record``, ``replay``, ``recover`` and ``plot``."""

from __future__ import annotations

import asyncio
import itertools
import json
import os
import re
import signal
import socket
from collections.abc import Callable
from itertools import pairwise
from pathlib import Path
from typing import TYPE_CHECKING

import pytest
import zstandard
from mcap.data_stream import RecordBuilder
from mcap.reader import make_reader
from mcap.records import Chunk, Header
from mcap.writer import Writer
from rosbags.highlevel import AnyReader

from robotiq_async import RobotiqHand, State
from robotiq_async.cli import main
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.recording.recordings import read_recording

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell


async def test_ctrl_c_ends_a_recording_that_is_whole_and_touches_nothing(
    shell: Shell, tmp_path: Path
) -> None:
    file = tmp_path / "it.mcap"
    gripper = SimulatedGripper(speedup=20)
    async with SimulatorServer(gripper) as server:
        process = await shell.start("record", str(file), server.address)
        assert await shell.read_line(process) == f"Gripper {server.address}"
        assert (await shell.read_line(process)).startswith("Recording ")
        async with asyncio.timeout(20):
            while os.stat(file).st_size < 3000:  # noqa: ASYNC110  # another process writes it
                await asyncio.sleep(0.05)
        process.send_signal(signal.SIGINT)
        outcome = await shell.finish(process)
        assert outcome.code == 0
        assert not gripper.writes
    assert " 0 lost, " in outcome.out
    recorded = [entry.sequence for entry in read_recording(file) if entry.topic == "/gripper/status"]
    assert recorded == list(range(recorded[0], recorded[-1] + 1))


def test_it_ends_by_itself(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    outcome = call("record", str(file), "--seconds", "0.5")
    outcome.assert_succeeded()
    assert len(list(read_recording(file))) > 20
    again = call("record", str(file), "--seconds", "0.5")
    again.assert_failed(1, "it.mcap: File exists")


def test_for_ros_2(call: Call, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    outcome = call("record", "--ros2", "--seconds", "0.5", str(file))
    outcome.assert_succeeded()
    with AnyReader([file]) as reader:
        assert [connection.topic for connection in reader.connections] == ["/joint_states"]
        assert f"\n{reader.message_count} polls, 0 lost" in outcome.out
    for command in ("replay", "plot"):
        call(command, str(file)).assert_failed(1, "it.mcap: it contains no")


def test_no_gripper_no_file(call: Call, tmp_path: Path) -> None:
    # Bound and not listening: connections are refused, and nobody else gets the port.
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        outcome = call("record", str(tmp_path / "it.mcap"), f"127.0.0.1:{reserved.getsockname()[1]}")
    outcome.assert_failed(1, "refused")
    assert not (tmp_path / "it.mcap").exists()


def test_replay_tells_the_story(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", str(grasp)]) == 0
    lines = capsys.readouterr().out.splitlines()
    story = [line.split(maxsplit=1)[1] for line in lines]
    assert any("command  act=1 go=1 release=0 A=255@200/64" in line for line in story)
    assert any("CONTACT_CLOSING" in line for line in story)
    (fault,) = [
        at for at, line in enumerate(story) if line.startswith("fault    0x09 COMMUNICATION_NOT_READY")
    ]
    assert story.index("state    FAULT -> RUNNING_IDLE (gripper is active)") > fault
    statuses = [line for line in story if line.startswith("status")]
    assert all(before != after for before, after in pairwise(statuses))


def test_recover_makes_a_broken_one_whole(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    whole = grasp.read_bytes()
    grasp.write_bytes(whole[: len(whole) // 2])
    assert main(["recover", str(grasp)]) == 0
    out = capsys.readouterr().out
    assert "was complete" not in out
    recovered = grasp.with_name("grasp.recovered.mcap")
    assert f"{len(list(read_recording(recovered)))} messages in {recovered}" in out
    assert main(["recover", str(grasp)]) == 1
    assert "File exists" in capsys.readouterr().err


@pytest.mark.parametrize("command", ["replay", "plot"])
def test_of_a_broken_one_it_is_said_that_it_is(
    command: str, grasp: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, str(grasp)]) == 0
    assert capsys.readouterr().err == ""
    whole = grasp.read_bytes()
    grasp.write_bytes(whole[: len(whole) * 2 // 3])
    assert main([command, str(grasp), "--overwrite"]) == 0
    out, err = capsys.readouterr()
    assert out
    assert err.count("\n") == 1
    assert "grasp.mcap ends too early, after " in err
    assert "robotiq-async recover" in err


def test_plot_draws_it(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", str(grasp)]) == 0
    pictures = [grasp.with_name(f"grasp.{suffix}") for suffix in ("png", "svg")]
    assert capsys.readouterr().out.splitlines() == [str(picture) for picture in pictures]
    before = pictures[1].read_bytes()
    assert b"COMMUNICATION_NOT_READY" in before or before.count(b"<use ") > 50, "words are drawn as glyphs"
    assert main(["plot", str(grasp), str(grasp.with_name("other"))]) == 0
    assert grasp.with_name("other.svg").exists()


def test_replay_draws_it_too(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["replay", "--plot", str(grasp)]) == 0
    assert capsys.readouterr().out.splitlines()[1] == str(grasp.with_suffix(".svg"))
    assert grasp.with_suffix(".svg").exists()


@pytest.mark.parametrize("command", ["replay", "recover", "plot", "export"])
@pytest.mark.parametrize("content", [None, b"", b"hello", b"no recording"])
def test_what_is_no_recording_is_one_line_and_nothing_is_written(
    command: str, content: bytes | None, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = tmp_path / "it.mcap"
    if content is not None:
        file.write_bytes(content)
    assert main([command, str(file)]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert ("No such file" if content is None else "not an MCAP file") in err
    assert [*tmp_path.iterdir()] == [file] * (content is not None)


@pytest.mark.parametrize(
    ("module", "arguments", "extra"),
    [
        ("mcap", ["record", "x.mcap"], "record"),
        ("mcap", ["replay", "x"], "record"),
        ("matplotlib", ["plot", "x"], "plot"),
    ],
)
def test_a_missing_extra_is_named(
    call: Call,
    without: Callable[[str], None],
    module: str,
    arguments: list[str],
    extra: str,
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    monkeypatch.chdir(tmp_path)
    without(module)
    call(*arguments).assert_failed(1, f"(the extra {extra})")
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("seconds", ["0", "-1", "nan", "soon"])
def test_wrong_usage(seconds: str, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["record", "x.mcap", "--seconds", seconds]) == 2
    assert "--seconds" in capsys.readouterr().err


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
        outcome = await shell.finish(await shell.python("-c", FULL.format(str(file), server.address)))
        assert hand.state is State.RUNNING_IDLE
    assert (outcome.code, outcome.err.count("\n")) == (1, 1), outcome.err
    assert "it.mcap: File too large" in outcome.err
    assert file.stat().st_size == 12_000
    there = [entry for entry in read_recording(file) if entry.topic == "/gripper/status"]
    assert there
    told = re.search(r"ended early: (\d+) of (\d+) polls at least are in the file; .*recover", outcome.out)
    assert told is not None, outcome.out
    assert 0 < int(told[1]) <= len(there) <= int(told[2])
    assert "0 lost" not in outcome.out


def test_a_picture_that_cannot_be_written(grasp: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["plot", str(grasp), str(grasp.parent / "nowhere" / "it")]) == 1
    assert "No such file or directory" in capsys.readouterr().err


def test_the_name_of_a_picture_may_have_its_suffix(grasp: Path) -> None:
    assert main(["plot", str(grasp), str(grasp.with_name("there.png"))]) == 0
    assert grasp.with_name("there.png").exists()
    assert grasp.with_name("there.svg").exists()


# -- recordings of others ----------------------------------------------------------------------------------


def event(**fields: object) -> bytes:
    return json.dumps({"timestamp": 1.0, **fields}).encode()


STATE = event(kind="state", target="RESET")
HOSTILE: dict[str, bytes] = {
    "not UTF-8": b'{"kind": "\xff"}',
    "no JSON": b"{",
    "a list": b"[]",
    "deeply nested": b"[" * 100_000,
    "without what it is about": event(kind="transition"),
    "a code that is no number": event(kind="fault", fault_code="9", fault="N", description="D"),
}
AXIS = {"position": 6, "requested": 0, "current_ma": 0, "status": "AT_POSITION"}
OTHER_NAMES = {
    "/gripper/status": (event(moving=False, **dict.fromkeys(("A", "B", "C", "SCISSOR"), AXIS)), "axis_state"),
    "/gripper/event": (event(kind="fault", code=9, name="N", description="D"), "fault_code"),
}
"""As they were recorded before, each with what it lacks first."""


SHOWS = {
    "replay": ("/gripper/event", "/gripper/status", "/gripper/command"),
    "plot": ("/gripper/event", "/gripper/status"),
    "export": ("/gripper/status",),
}
"""What each command looks at."""


@pytest.mark.parametrize("command", SHOWS)
def test_what_is_not_ours_is_refused_in_one_line_and_nothing_is_written(
    foreign: Callable[..., Path], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    for topic, (what, data) in itertools.product(SHOWS[command], HOSTILE.items()):
        if command != "replay" and "code" in what:
            continue
        file = foreign(data, topic=topic)
        assert main([command, str(file)]) == 1
        err = capsys.readouterr().err
        assert err.count("\n") == 1
        assert f"foreign.mcap: a message on '{topic}' is no" in err, what
        assert [*file.parent.iterdir()] == [file]


@pytest.mark.parametrize("topic", OTHER_NAMES)
@pytest.mark.parametrize("command", ["replay", "plot"])
def test_a_recording_with_other_names_is_one_line_that_says_so(
    foreign: Callable[..., Path], command: str, topic: str, capsys: pytest.CaptureFixture[str]
) -> None:
    message, lacks = OTHER_NAMES[topic]
    assert main([command, str(foreign(message, topic=topic))]) == 1
    out, err = capsys.readouterr()
    assert out == ""
    lacks = {"axis_state": "requested_position", "fault_code": "fault"}[lacks] if command == "plot" else lacks
    why = f"is not one of ours, or of another version of robotiq_async: it has no '{lacks}'"
    assert err == f"robotiq-async: {foreign()}: a message on '{topic}' {why}\n"


@pytest.mark.parametrize("command", ["replay", "plot", "recover"])
def test_a_message_of_no_channel_is_one_line(
    foreign: Callable[..., Path], command: str, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, str(foreign(STATE, channel=7))]) == 1
    err = capsys.readouterr().err
    assert err.count("\n") == 1
    assert "foreign.mcap: there is no channel 7" in err


STEERING = "\x1b[2J\x9b31m\x07\r\nroot# \u202e\ud800"


def test_what_steers_a_terminal_is_written_out(
    foreign: Callable[..., Path], capsys: pytest.CaptureFixture[str]
) -> None:
    fault = event(kind="fault", fault_code=9, fault=STEERING, description=STEERING)
    assert main(["replay", str(foreign(fault))]) == 0
    out, err = capsys.readouterr()
    assert out.count("\n") == 1
    assert r"\x1b[2J\x9b31m\x07\r\nroot# \u202e\ud800" in out
    assert out.rstrip("\n").isprintable()
    assert err == ""


@pytest.mark.parametrize("command", ["replay", "plot", "recover"])
def test_an_error_does_not_steer_the_terminal_either(
    command: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main([command, str(tmp_path / f"{STEERING}.mcap".replace("\ud800", ""))]) == 1
    err = capsys.readouterr().err
    assert err.rstrip("\n").isprintable()
    assert r"\x1b[2J" in err


@pytest.mark.parametrize("options", [[], ["--brief"]])
def test_nothing_to_show_is_said(
    foreign: Callable[..., Path], options: list[str], capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["replay", *options, str(foreign(b"{}", topic="/odometry"))]) == 1
    assert "foreign.mcap: it contains nothing that this command shows" in capsys.readouterr().err


def test_a_name_that_is_no_text_is_shown_all_the_same(
    grasp: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    there = Path(os.fsdecode(os.fsencode(grasp.parent) + b"/\xff$\\frac{$.mcap"))
    grasp.rename(there)
    assert main(["plot", str(there)]) == 0
    assert capsys.readouterr().out.endswith(".svg\n")
    assert main(["recover", str(there)]) == 0
    assert "messages in" in capsys.readouterr().out


@pytest.mark.parametrize("words", ["$\\frac{", "x" * 100_000, STEERING])
def test_words_of_others_are_drawn_as_they_are(
    grasp: Path, words: str, capsys: pytest.CaptureFixture[str]
) -> None:
    with grasp.open("rb") as stream:
        first = next(make_reader(stream).iter_messages(topics=["/gripper/status"]))[2]
    file = grasp.with_name("foreign.mcap")
    with file.open("wb") as stream:
        writer = Writer(stream)
        writer.start()
        for topic in ("/gripper/status", "/gripper/event"):
            writer.register_channel(topic, "json", 0)
        for second in range(3):
            writer.add_message(1, first.log_time + second * 10**9, first.data, 0)
            writer.add_message(2, first.log_time + second * 10**9, event(kind="state", target=words), 0)
        writer.finish()  # type: ignore[no-untyped-call]
    assert main(["plot", str(file)]) == 0, capsys.readouterr().err


async def test_two_gigabytes_in_a_small_chunk_are_one_line(shell: Shell, tmp_path: Path) -> None:
    file = tmp_path / "bomb.mcap"
    compressor = zstandard.ZstdCompressor().compressobj()
    data = b"".join(compressor.compress(bytes(2**20)) for _ in range(2048)) + compressor.flush()
    builder = RecordBuilder()
    Header("", "").write(builder)
    Chunk("zstd", data, 0, 0, 0, 2**31).write(builder)
    file.write_bytes(b"\x89MCAP0\r\n" + builder.end())  # type: ignore[no-untyped-call]
    outcome = await shell.finish(await shell.python("-c", LITTLE_MEMORY.format(str(file))))
    assert (outcome.code, outcome.out) == (0, "1 1 1\n"), outcome.err
    lines = outcome.err.splitlines()
    assert len(lines) == 3
    for line in lines:
        assert line.startswith("robotiq-async: ")
        assert "bomb.mcap: a chunk of 2147483648 bytes" in line


LITTLE_MEMORY = """
import resource, sys
resource.setrlimit(resource.RLIMIT_AS, (1_500_000_000, 1_500_000_000))
from robotiq_async.cli import main
print(*(main([command, {!r}]) for command in ("replay", "recover", "plot")))
"""
"""Of addresses; matplotlib takes most of them."""
