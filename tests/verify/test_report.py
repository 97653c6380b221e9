"""The files of a run: report.json, report.md, recording.mcap."""

from __future__ import annotations

import asyncio
import getpass
import json
import platform
import re
import resource
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pytest

from robotiq_async import THREE_FINGER, TWO_FINGER_85, Model, RobotiqHand
from robotiq_async.cli.agent_file import read_agent_file
from robotiq_async.link.address import Address, parse_address
from robotiq_async.ros2.translation.settings import PARAMETERS, check_parameter
from robotiq_async.simulator import SimulatorServer, Trouble
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.verify import CATALOGUE, ENDINGS, Check, CheckVerdict, Plan, Report, Runner
from robotiq_async.tools.verify.files import JSON, PAGE, RECORDING_NAME, Folder, Recording, Scrubber
from robotiq_async.tools.verify.recorded_link import RecordedExchange
from robotiq_async.tools.verify.report import SCHEMA, lines, page, sentences
from tests.docs.pages import read, table
from tests.register_words import status_of
from tests.verify.people import SHORT, Helper, Roll, served, threads, verified
from tests.virtual import run

HARDWARE = read("hardware.md")


def begun(path: Path, server: SimulatorServer, **plan: Any) -> tuple[Folder, Runner]:
    """A folder for a run, and the run."""
    address = parse_address(server.address)
    folder = Folder(path, address)
    wanted = Plan(address, lengths=SHORT, **plan)
    return folder, Runner(wanted, Helper(server), folder.recording, folder.save)


class Both(Roll):
    """Keeps frames on a roll and in a recording."""

    def __init__(self, recording: Recording) -> None:
        super().__init__()
        self._recording = recording

    def keep(self, frame: RecordedExchange) -> None:
        super().keep(frame)
        self._recording.keep(frame)

    def begin(self, stage: int) -> None:
        super().begin(stage)
        self._recording.begin(stage)


class Kept(NamedTuple):
    """A run up to the activation, and what was on the disk each time that the report was saved."""

    report: Report
    path: Path
    frames: list[RecordedExchange]
    stages: list[list[int]]
    pages: list[str]


@pytest.fixture(scope="module")
def no_pictures() -> Iterator[None]:
    """Without the extra: test_replay has them, and they take longer than a run."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setitem(sys.modules, "matplotlib.figure", None)
        patch.delitem(sys.modules, "robotiq_async.tools.verify.pictures", raising=False)
        yield


@pytest.fixture(scope="module")
def kept(tmp_path_factory: pytest.TempPathFactory, no_pictures: None) -> Kept:
    """It is made once, for tests that only look at it."""
    path = tmp_path_factory.mktemp("run") / "new" / "folder"

    async def main() -> Kept:
        async with served() as server, threads():
            address = parse_address(server.address)
            folder = Folder(path, address)
            roll = Both(folder.recording)
            stages: list[list[int]] = []
            pages: list[str] = []

            def save(report: Report) -> None:
                folder.save(report)
                stages.append(json.loads((path / JSON).read_text())["stages"])
                pages.append((path / PAGE).read_text())

            report = await Runner(Plan(address, last=3, lengths=SHORT), Helper(server), roll, save).run()
            assert not await folder.end(report)
            return Kept(report, path, roll.frames, stages, pages)

    return run(main)


def test_the_files_hold_the_run(kept: Kept) -> None:
    fields = json.loads((kept.path / JSON).read_text())
    assert fields == json.loads(json.dumps(kept.report.as_dict()))
    assert fields["schema"] == SCHEMA
    assert fields["ended"]["why"] == "done"
    assert fields["stages"] == [0, 1, 2, 3]
    text = (kept.path / PAGE).read_text()
    for sentence in sentences(kept.report):
        assert sentence in text
    for name in kept.report.checks:
        assert f"`{name}`" in text
    assert not list(kept.path.glob(".*"))


def test_without_the_extra_for_pictures_the_page_says_so(kept: Kept) -> None:
    assert "pictures need matplotlib" in (kept.path / PAGE).read_text()


def test_the_recording_has_every_frame(kept: Kept) -> None:
    entries = [(entry.topic, json.loads(entry.data)) for entry in read_recording(kept.path / RECORDING_NAME)]
    for topic, kind in (("/gripper/status", "status"), ("/gripper/command", "command")):
        registers = [fields["registers"] for name, fields in entries if name == topic]
        assert registers == [list(frame.registers) for frame in kept.frames if frame.kind == kind]
        assert registers
    stages = [fields["target"] for name, fields in entries if fields.get("kind") == "state"]
    assert stages == [f"verify stage {number}" for number in range(4)]


# -- nothing about the place -----------------------------------------------------------------------------


@pytest.mark.virtual_time
@pytest.mark.usefixtures("no_pictures")
@pytest.mark.parametrize("trouble", ["one-connection-only", "silence", "drop"])
async def test_no_address_host_or_user_is_in_it(tmp_path: Path, trouble: str) -> None:
    """Errors of the link name the address, and reach all three files."""
    async with served() as server, threads():
        address = parse_address(server.address)
        folder, runner = begun(tmp_path, server, last=1)
        running = asyncio.ensure_future(runner.run())
        await asyncio.sleep(0 if trouble == "one-connection-only" else 5)
        await server.fault_injector.begin(Trouble(trouble))
        report = await running
        await folder.end(report)
        said = f"{report.words} {[check.found for check in report.checks.values()]}"
        assert server.address in said, "nothing was to be hidden"
    files = [(tmp_path / name).read_text() for name in (JSON, PAGE)]
    files += [entry.data.decode() for entry in read_recording(tmp_path / RECORDING_NAME)]
    for text in files:
        for secret in (address.host, str(address.port), platform.node(), str(Path.home())):
            assert secret not in text
        assert not re.search(rf"\b{re.escape(getpass.getuser())}\b", text.replace("/root", ""))


def test_the_address_is_hidden_everywhere() -> None:
    scrub = Scrubber(parse_address("tcp://Gripper-7.example:5020")).clean
    text = "cannot connect to tcp://gripper-7.example:5020: gripper-7.example does not answer"
    assert "gripper-7" not in scrub(text)
    assert scrub({"a": [text, 3], "b": {"c": None}}) == {"a": [scrub(text), 3], "b": {"c": None}}
    scrub = Scrubber(parse_address("rtu:///dev/serial/by-id/usb-FTDI_A50285BI")).clean
    assert "A50285BI" not in scrub("rtu:///dev/serial/by-id/usb-FTDI_A50285BI did not answer within 0.4 s")
    tunnel = Address("tunnel", "arm.example", 502, scheme="xarm", options=(("token", "s3cret"),))
    assert Scrubber(tunnel).clean("arm.example refuses s3cret") == "HIDDEN refuses HIDDEN"


# -- a disk that does not take it --------------------------------------------------------------------------


async def test_a_folder_that_has_a_report_or_cannot_be_made_is_refused(tmp_path: Path) -> None:
    (tmp_path / RECORDING_NAME).write_bytes(b"the first hour")
    with pytest.raises(FileExistsError):
        Folder(tmp_path, parse_address("127.0.0.1"))
    assert (tmp_path / RECORDING_NAME).read_bytes() == b"the first hour"
    with pytest.raises(NotADirectoryError):
        Folder(tmp_path / RECORDING_NAME / "report", parse_address("127.0.0.1"))


@contextmanager
def full_disk(size: int) -> Iterator[None]:
    """No file grows beyond that."""
    before = resource.getrlimit(resource.RLIMIT_FSIZE)
    resource.setrlimit(resource.RLIMIT_FSIZE, (size, before[1]))
    try:
        yield
    finally:
        resource.setrlimit(resource.RLIMIT_FSIZE, before)


@pytest.mark.virtual_time
async def test_a_full_disk_ends_the_run_after_the_stage(tmp_path: Path) -> None:
    async with served() as server, threads():
        folder, runner = begun(tmp_path, server)
        with full_disk(20_000):
            report = await runner.run()
            failure = await folder.end(report)
        assert report.why == "disk"
        assert failure
        assert folder._why_no_pictures.startswith("the recording has failed")
        assert report.stages == report.entered
        assert len(report.stages) < 10
        assert not server.gripper.is_moving
        assert not server.gripper.status_registers()[0] & 0x0800
    assert list(read_recording(tmp_path / RECORDING_NAME)), "what was written before is lost"


async def test_a_report_that_cannot_be_written_leaves_no_part_of_it(tmp_path: Path) -> None:
    folder = Folder(tmp_path, parse_address("192.0.2.1"))
    with full_disk(100), pytest.raises(OSError, match="large"):
        folder.save(report_with())
    assert {path.name for path in tmp_path.iterdir()} == {RECORDING_NAME}  # noqa: ASYNC240
    await folder.recording.end()


@pytest.mark.virtual_time
async def test_a_report_that_cannot_be_written_ends_the_run_after_the_stage() -> None:
    def fail(_: Report) -> None:
        raise OSError(28, "No space left on device")

    async with served() as server:
        report = await verified(server, save=fail)
        assert (report.why, report.stages) == ("disk", [0])


def test_after_each_stage_the_report_is_on_the_disk(kept: Kept) -> None:
    """So a run that is killed leaves its findings."""
    assert kept.stages == [[0], [0, 1], [0, 1], [0, 1, 2], [0, 1, 2], [0, 1, 2, 3]], (
        "and before each that writes"
    )


def test_a_run_that_is_killed_in_a_stage_that_writes_says_that_the_fingers_may_move(kept: Kept) -> None:
    """It read "nothing speaks against using this gripper ... it was killed: -."."""
    after_0, after_1, before_2, after_2, before_3, after_3 = kept.pages
    for stage, text in (2, before_2), (3, before_3):
        assert f"THE FINGERS MAY STILL MOVE: stage {stage} has begun, and the run has not ended" in text
    for text in kept.pages:
        assert "The run has not ended, or was killed." in text
        assert "nothing speaks against" not in text
        assert "Lines to paste" not in text
    for text in (after_0, after_1, after_2, after_3):
        assert "FINGERS MAY" not in text
    assert "Lines to paste" in (kept.path / PAGE).read_text(), "of a run that has ended"


def test_above_do_not_use_there_are_no_lines_to_paste() -> None:
    report = report_with(poll_interval=0.061)
    assert "poll_interval=0.061" in page(report)
    report.why, report.words = "deviation", "a safety check differs"
    assert "Do not use this gripper" in page(report)
    assert "poll_interval=0.061" not in page(report)
    assert "Lines to paste" not in page(report)


# -- what follows ------------------------------------------------------------------------------------------


def report_with(**options: float) -> Report:
    check = Check("read.registers", CheckVerdict.DIFFERS, "as found", "so it goes", options)
    found, stages = status_of(0x31), [0, 1, 2]
    return Report("tcp", stages=stages, entered=stages[:], checks={check.name: check}, why="done", last=found)


EVERY = {
    "device_id": 9,
    "read_function": 3,
    "request_address": 1000,
    "status_address": 2000,
    "poll_interval": 0.061,
    "write_spacing": 0.042,
    "activation_timeout": 53,
}


@pytest.mark.parametrize("model", [THREE_FINGER, TWO_FINGER_85])
def test_the_lines_to_paste_are_taken(tmp_path: Path, model: Model) -> None:
    report = report_with(**EVERY)
    report.model = model
    said = {name: text.replace("ADDRESS", "tcp://192.0.2.1") for name, text in lines(report).items()}
    hand = eval(said["Python"], {"RobotiqHand": RobotiqHand})
    assert isinstance(hand, RobotiqHand)
    assert hand.model is model
    file = tmp_path / "FLEET.toml"
    file.write_text('site = "lab"\n' + said["FLEET.toml"])
    settings = read_agent_file(file).grippers["NAME"]
    assert settings.model is model
    assert {name: getattr(settings, name) for name in EVERY} == EVERY
    given = dict(re.findall(r"-p (\w+):=(\S+)", said["ROS 2"]))
    assert given.pop("address") == "tcp://192.0.2.1"
    assert given.pop("model", None) == (None if model is THREE_FINGER else "2f85")
    assert given
    for name, value in given.items():
        check_parameter(name, type(PARAMETERS[name].default)(float(value)))
    for name in EVERY.keys() - given:
        assert name not in PARAMETERS
        assert name in said["ROS 2"]
    assert f"Checked as a {model}, link tcp." in page(report)


@pytest.mark.parametrize("why", ENDINGS)
def test_three_sentences_for_every_ending(why: str) -> None:
    report = report_with()
    report.why, report.words = why, "so it was"
    usable, known, wanted = sentences(report)
    is_bad = why in ("fault", "envelope", "time", "foreign", "deviation", "inactive", "unstopped")
    assert usable.startswith("Do not use" if is_bad else "So far nothing speaks against")
    assert is_bad or usable.endswith("It has not moved yet.")
    assert "not finished: stage 3, 4, 5, 6, 7, 8, 9" in known
    assert "read.registers" in wanted
    report.stages = [0]
    if why in ("refused", "link"):
        assert "could not be judged" in sentences(report)[0]
    usable, _, wanted = sentences(Report("tcp", stages=[0], entered=[0], why="done"))
    assert usable.startswith("Nothing is known about the gripper")
    assert wanted == "There is nothing to send yet."


@pytest.mark.parametrize("why", ENDINGS)
def test_a_stop_that_was_not_confirmed_is_the_first_sentence(why: str) -> None:
    """After "THE FINGERS MAY STILL MOVE" the report said that nothing speaks against using the gripper."""
    report = report_with()
    report.why, report.words, report.last = why, "so it was", None
    assert sentences(report)[0].startswith("THE FINGERS MAY STILL MOVE: the last rGTO = 0 was not confirmed")
    assert "THE FINGERS MAY STILL MOVE" in page(report)


def test_a_stage_that_was_not_finished_is_named() -> None:
    usable, _, wanted = sentences(Report("tcp", entered=[4], why="stopped", last=status_of(0x31)))
    assert usable == "Too little is known about the gripper yet: stage 4 was not finished."
    assert "if this end surprises you" in wanted


def test_only_a_whole_run_says_that_the_gripper_can_be_used() -> None:
    report = report_with(write_spacing=0.042)
    report.stages = report.entered = list(range(10))
    assert sentences(report)[0] == "This gripper can be used with write_spacing=0.042."
    report.stages = list(range(9))
    assert sentences(report)[0].endswith(
        "nothing speaks against using this gripper with write_spacing=0.042."
    )


def test_checks_that_were_not_reached_are_said_to_be_so() -> None:
    report = Report("tcp", entered=[0, 1])
    report.complete()
    assert report.checks.keys() == {name for name, each in CATALOGUE.items() if each.stage <= 1}
    assert {check.verdict for check in report.checks.values()} == {CheckVerdict.INCONCLUSIVE}


# -- the page that describes them --------------------------------------------------------------------------


def first_cells(heading: str) -> list[str]:
    _, *rows = table("hardware.md", heading)
    return [cells[0].strip("`") for cells in rows]


def test_the_page_names_every_key_ending_and_check() -> None:
    keys = [key for cell in first_cells("### report.json") for key in re.findall(r"\w+", cell)]
    assert keys == list(report_with().as_dict())
    _, *stops = table("how-to/first-hour.md", "## When it stops")
    assert {"done", *re.findall(r"`(\w+)`", " ".join(reasons for reasons, _ in stops))} == ENDINGS.keys()
    assert first_cells("## What is checked") == list(CATALOGUE)
    files = {"report.json", "report.md", "recording.mcap"}
    named = set(re.findall(r"`([a-z]+\.[a-z_0-9]+)`", HARDWARE)) - files
    assert named == {*CATALOGUE}


def test_every_question_that_no_source_settles_has_an_answer() -> None:
    """A check, or the reason why there is none."""
    registers = read("registers.md").partition("## What no public source settles")[2]
    asked = re.findall(r"^- \*\*[^*]+\?\*\* (.*\n(?:  .*\n)*)", registers, re.MULTILINE)
    assert len(asked) == registers.count("\n- ") > 15
    for answer in asked:
        assert "No check" in answer or {*re.findall(r"`(\w+\.\w+)`", answer)} & {*CATALOGUE}
