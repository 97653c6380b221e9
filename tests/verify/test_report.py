"""What a run leaves behind: report.json, report.md, recording.mcap."""

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

import pytest

from robotiq_async import TWO_FINGER_85, RobotiqHand
from robotiq_async.fleet.agent.agent_file import read_agent_file
from robotiq_async.link.address import parse_address
from robotiq_async.ros2.translation.settings import PARAMETERS, check_parameter
from robotiq_async.simulator import Trouble
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.verify import CATALOGUE, ENDINGS, Check, Plan, Report, Runner, Verdict
from robotiq_async.tools.verify.files import JSON, NAME, PAGE, Folder, Scrubber
from robotiq_async.tools.verify.report import SCHEMA, lines, page, sentences
from tests.docs.pages import DOCS
from tests.verify.people import SHORT, Helper, Roll, served, threads, verified

HARDWARE = (DOCS / "hardware.md").read_text(encoding="utf-8")


async def recorded(path: Path, *troubles: str, **plan: int) -> tuple[Report, Folder, str]:
    """A run that leaves files, and the port of the gripper."""
    async with served(*troubles) as server, threads():
        address = parse_address(server.address)
        folder = Folder(path, address)
        wanted = Plan(address, lengths=SHORT, **{"last": 3} | plan)  # type: ignore[arg-type]
        runner = Runner(wanted, Helper(server), folder.recording, folder.save)
        report = await runner.run()
        assert not await folder.end(report)
        return report, folder, server.address


@pytest.mark.virtual_time
async def test_the_files_hold_the_run(tmp_path: Path) -> None:
    report, folder, _ = await recorded(tmp_path / "new" / "folder")
    fields = json.loads((folder.path / JSON).read_text())
    assert fields == json.loads(json.dumps(report.as_dict()))
    assert fields["schema"] == SCHEMA
    assert fields["ended"]["why"] == "done"
    assert fields["stages"] == [0, 1, 2, 3]
    text = (folder.path / PAGE).read_text()
    for sentence in sentences(report):
        assert sentence in text
    for name in report.checks:
        assert f"`{name}`" in text
    assert not list(folder.path.glob(".*"))


@pytest.mark.virtual_time
async def test_without_the_extra_for_pictures_the_page_says_so(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setitem(sys.modules, "matplotlib.figure", None)
    monkeypatch.delitem(sys.modules, "robotiq_async.tools.verify.pictures", raising=False)
    _, folder, _ = await recorded(tmp_path, last=1)
    assert "pictures need matplotlib" in (folder.path / PAGE).read_text()


@pytest.mark.virtual_time
async def test_the_recording_has_every_frame(tmp_path: Path) -> None:
    async with served() as server, threads():
        address = parse_address(server.address)
        folder, roll = Folder(tmp_path, address), Roll()
        both = Both(folder, roll)
        runner = Runner(Plan(address, last=3, lengths=SHORT), Helper(server), both, folder.save)
        await runner.run()
        await folder.end(runner.report)
    entries = [(entry.topic, json.loads(entry.data)) for entry in read_recording(folder.path / NAME)]
    for topic, kind in (("/gripper/status", "status"), ("/gripper/command", "command")):
        kept = [fields["registers"] for name, fields in entries if name == topic]
        assert kept == [list(frame.registers) for frame in roll.frames if frame.kind == kind]
        assert kept
    stages = [fields["target"] for name, fields in entries if fields.get("kind") == "state"]
    assert stages == [f"verify stage {number}" for number in range(4)]


class Both:
    """Keeps frames in a folder and on a roll."""

    failure = ""

    def __init__(self, folder: Folder, roll: Roll) -> None:
        self._tapes = (folder.recording, roll)

    def keep(self, frame: object) -> None:
        for tape in self._tapes:
            tape.keep(frame)  # type: ignore[arg-type]

    def begin(self, stage: int) -> None:
        for tape in self._tapes:
            tape.begin(stage)


# -- nothing that tells where it was ---------------------------------------------------------------------


@pytest.mark.virtual_time
@pytest.mark.parametrize("trouble", ["one-connection-only", "silence", "drop"])
async def test_no_address_host_or_user_is_in_it(tmp_path: Path, trouble: str) -> None:
    """Errors of the link name the address, and reach all three files."""
    async with served() as server, threads():
        address = parse_address(server.address)
        folder = Folder(tmp_path, address)
        runner = Runner(Plan(address, last=1, lengths=SHORT), Helper(server), folder.recording, folder.save)
        running = asyncio.ensure_future(runner.run())
        await asyncio.sleep(0 if trouble == "one-connection-only" else 5)
        await server.fault_injector.begin(Trouble(trouble))
        report = await running
        await folder.end(report)
        told = f"{report.words} {[check.found for check in report.checks.values()]}"
        assert server.address in told, "nothing was to be hidden"
    files = [(tmp_path / name).read_text() for name in (JSON, PAGE)]
    files += [entry.data.decode() for entry in read_recording(tmp_path / NAME)]
    for text in files:
        for secret in (address.host, str(address.port), platform.node(), str(Path.home())):
            assert secret not in text
        assert not re.search(rf"\b{re.escape(getpass.getuser())}\b", text.replace("/root", ""))


def test_what_is_hidden_is_hidden_everywhere() -> None:
    scrub = Scrubber(parse_address("tcp://Gripper-7.example:5020")).clean
    text = "cannot connect to tcp://gripper-7.example:5020: gripper-7.example does not answer"
    assert "gripper-7" not in scrub(text)
    assert scrub({"a": [text, 3], "b": {"c": None}}) == {"a": [scrub(text), 3], "b": {"c": None}}


def test_a_serial_port_is_hidden() -> None:
    scrub = Scrubber(parse_address("rtu:///dev/serial/by-id/usb-FTDI_A50285BI")).clean
    assert "A50285BI" not in scrub("rtu:///dev/serial/by-id/usb-FTDI_A50285BI did not answer within 0.4 s")


# -- a disk that does not take it --------------------------------------------------------------------------


async def test_a_folder_that_has_a_report_is_refused(tmp_path: Path) -> None:
    (tmp_path / NAME).write_bytes(b"the first hour")
    with pytest.raises(FileExistsError):
        Folder(tmp_path, parse_address("127.0.0.1"))
    assert (tmp_path / NAME).read_bytes() == b"the first hour"


async def test_a_place_where_no_folder_can_be(tmp_path: Path) -> None:
    (tmp_path / "file").write_text("")
    with pytest.raises(OSError, match="file"):
        Folder(tmp_path / "file" / "report", parse_address("127.0.0.1"))


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
        address = parse_address(server.address)
        folder = Folder(tmp_path, address)
        runner = Runner(Plan(address, lengths=SHORT), Helper(server), folder.recording, folder.save)
        with full_disk(20_000):
            report = await runner.run()
            failure = await folder.end(report)
        assert report.why == "disk"
        assert failure
        assert report.stages == report.entered
        assert len(report.stages) < 10
        assert not server.gripper.is_moving
        assert not server.gripper.status_registers()[0] & 0x0800
    assert list(read_recording(tmp_path / NAME)), "what was written before is lost"


@pytest.mark.virtual_time
async def test_a_report_that_cannot_be_written_ends_the_run_after_the_stage() -> None:
    def fail(_: Report) -> None:
        raise OSError(28, "No space left on device")

    async with served() as server:
        report = await verified(server, save=fail)
        assert (report.why, report.stages) == ("disk", [0])


@pytest.mark.virtual_time
async def test_after_each_stage_the_report_is_on_the_disk(tmp_path: Path) -> None:
    """So a run that is killed leaves what it knew."""
    seen: list[list[int]] = []
    async with served() as server, threads():
        address = parse_address(server.address)
        folder = Folder(tmp_path, address)

        def save(report: Report) -> None:
            folder.save(report)
            seen.append(json.loads((tmp_path / JSON).read_text())["stages"])

        await Runner(Plan(address, last=3, lengths=SHORT), Helper(server), folder.recording, save).run()
        await folder.end(Report("tcp"))
    assert seen == [[0], [0, 1], [0, 1, 2], [0, 1, 2, 3]]


# -- what follows ------------------------------------------------------------------------------------------


def report_with(**options: float) -> Report:
    check = Check("read.registers", Verdict.DIFFERS, "as found", "so it goes", options)
    return Report("tcp", stages=[0, 1, 2], entered=[0, 1, 2], checks={check.name: check}, why="done")


EVERY = {
    "device_id": 9,
    "read_function": 3,
    "request_address": 1000,
    "status_address": 2000,
    "poll_interval": 0.061,
    "write_spacing": 0.042,
    "activation_timeout": 53,
}


def test_the_lines_to_paste_are_taken(tmp_path: Path) -> None:
    told = lines(report_with(**EVERY))
    hand = eval(told["Python"].replace("ADDRESS", "tcp://192.0.2.1"), {"RobotiqHand": RobotiqHand})
    assert isinstance(hand, RobotiqHand)
    file = tmp_path / "FLEET.toml"
    file.write_text('site = "lab"\n' + told["FLEET.toml"].replace("ADDRESS", "tcp://192.0.2.1"))
    settings = read_agent_file(file).grippers["NAME"]
    assert {name: getattr(settings, name) for name in EVERY} == EVERY
    given = dict(re.findall(r"-p (\w+):=(\S+)", told["ROS 2"]))
    assert given.pop("address") == "ADDRESS"
    assert given
    for name, value in given.items():
        check_parameter(name, type(PARAMETERS[name].default)(float(value)))
    for name in EVERY.keys() - given:
        assert name not in PARAMETERS
        assert name in told["ROS 2"]


def test_every_option_that_a_check_may_name_is_one_of_a_hand() -> None:
    RobotiqHand("tcp://192.0.2.1", **EVERY)  # type: ignore[arg-type]


@pytest.mark.parametrize("why", ENDINGS)
def test_three_sentences_for_every_ending(why: str) -> None:
    report = report_with()
    report.why, report.words = why, "so it was"
    usable, known, wanted = sentences(report)
    is_bad = why in ("fault", "envelope", "time", "foreign", "deviation", "inactive")
    assert usable.startswith("Do not use" if is_bad else "This gripper can be used")
    assert "not finished: stage 3, 4, 5, 6, 7, 8, 9" in known
    assert "read.registers" in wanted
    report.stages = [0]
    if why in ("refused", "link"):
        assert "could not be judged" in sentences(report)[0]


def test_stage_0_alone_says_nothing_of_the_gripper() -> None:
    report = Report("tcp", stages=[0], entered=[0], why="done")
    usable, _, wanted = sentences(report)
    assert usable.startswith("Nothing is known of the gripper")
    assert wanted == "There is nothing to send yet."


def test_the_lines_to_paste_name_the_model(tmp_path: Path) -> None:
    report = report_with(**EVERY)
    report.model = TWO_FINGER_85
    told = lines(report)
    hand = eval(told["Python"].replace("ADDRESS", "tcp://192.0.2.1"), {"RobotiqHand": RobotiqHand})
    assert hand.model is TWO_FINGER_85
    file = tmp_path / "FLEET.toml"
    file.write_text('site = "lab"\n' + told["FLEET.toml"].replace("ADDRESS", "tcp://192.0.2.1"))
    assert read_agent_file(file).grippers["NAME"].model is TWO_FINGER_85
    assert "-p model:=2f85" in told["ROS 2"]
    assert "Looked at as a 2F-85, link tcp." in page(report)


def test_checks_that_were_not_reached_are_said_to_be_so() -> None:
    report = Report("tcp", entered=[0, 1])
    report.complete()
    assert report.checks.keys() == {name for name, each in CATALOGUE.items() if each.stage <= 1}
    assert {check.verdict for check in report.checks.values()} == {Verdict.UNTOLD}


# -- the page that describes them --------------------------------------------------------------------------


def first_cells(heading: str) -> list[str]:
    section = HARDWARE.partition(f"{heading}\n")[2].partition("\n#")[0]
    return re.findall(r"^\| `([^`]+)`", section.partition("| -- |")[2], re.MULTILINE)


def test_the_page_names_every_key_of_the_report() -> None:
    assert first_cells("### report.json") == list(report_with().as_dict())


def test_the_page_names_every_ending() -> None:
    assert first_cells("### How a run ends") == list(ENDINGS)


def test_the_page_names_every_check() -> None:
    assert first_cells("## What is checked") == list(CATALOGUE)


def test_every_question_that_no_source_settles_has_an_answer() -> None:
    """A check, or the reason why there is none."""
    registers = (
        (DOCS / "registers.md").read_text(encoding="utf-8").partition("## What no public source settles")[2]
    )
    asked = re.findall(r"^\| ([^|]+\?) \|", registers, re.MULTILINE)
    answers = re.findall(r"^\| [^|]+\? \|.* \| ([^|]+) \|$", registers, re.MULTILINE)
    assert asked
    assert len(answers) == len(asked)
    for answer in answers:
        assert answer.startswith("none: ") or {*re.findall(r"`(\w+\.\w+)`", answer)} & {*CATALOGUE}


def test_every_check_that_the_page_names_is_one() -> None:
    named = set(re.findall(r"`([a-z]+\.[a-z_]+)`", HARDWARE)) - {"report.json", "report.md", "recording.mcap"}
    assert named == {*CATALOGUE}
