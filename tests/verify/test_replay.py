"""A recording is replayed against the simulator and the decoder: ``python -m tests.hardware``."""

from __future__ import annotations

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from robotiq_async.link.address import parse_address
from robotiq_async.simulator.physics.habits import Habits
from robotiq_async.simulator.troubles.like_hardware import like_hardware, own_habits
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.tools.verify import Plan, Runner, pictures
from robotiq_async.tools.verify.files import RECORDING_NAME, Folder
from robotiq_async.tools.verify.pictures import segments
from robotiq_async.values.enums import ObjectStatus
from robotiq_async.values.model import THREE_FINGER, TWO_FINGER_85, Model
from tests import hardware
from tests.verify.people import SHORT, Helper, served, threads
from tests.virtual import run

Change = Callable[[str, dict[str, Any]], None]


async def record(
    folder: Path,
    *,
    is_like_hardware: bool = False,
    first: int = 0,
    last: int = 6,
    model: Model = THREE_FINGER,
    has_pictures: bool = True,
) -> None:
    troubles = [str(habit) for habit in like_hardware(model)] if is_like_hardware else []
    habits = own_habits(model) if is_like_hardware else None
    async with served(*troubles, habits=habits, model=model) as server, threads():
        address = parse_address(server.address)
        into = Folder(folder, address)
        plan = Plan(address, first=first, last=last, lengths=SHORT)
        report = await Runner(plan, Helper(server), into.recording, into.save).run()
        assert report.why == "done"
        if has_pictures:
            assert not await into.end(report)
        else:
            await into.recording.end()
            assert not into.recording.failure


def recording(**options: Any) -> Any:
    """A fixture: a recording that is made once."""

    @pytest.fixture(scope="module")
    def made(tmp_path_factory: pytest.TempPathFactory) -> Path:
        folder = tmp_path_factory.mktemp("recording")
        run(lambda: record(folder, **options))
        return folder / RECORDING_NAME

    return made


plain, short = recording(has_pictures=False), recording(first=2, last=3)
"""Recordings to the last stage that is compared, and from the first that writes to the activation."""
hardware_like = recording(is_like_hardware=True, has_pictures=False, last=5)
jaw = recording(model=TWO_FINGER_85)


def test_a_recording_of_a_sibling_knows_its_model_and_differs_in_nothing(jaw: Path) -> None:
    assert not [*hardware.differences(str(jaw), Habits())]
    (segment,) = segments(jaw, (6,))
    assert {status.model for _, status in segment.statuses} == {TWO_FINGER_85}
    report = json.loads((jaw.parent / "report.json").read_text())
    assert report["model"] == "2f85"
    assert "stroke.scissor" not in {check["name"] for check in report["checks"]}


def test_each_measured_curve_has_its_picture(jaw: Path, short: Path) -> None:
    for recording, names in (
        (jaw, ["activation.png", "echo.png", "round_trips.png", "strokes.png"]),
        (short, ["activation.png"]),
    ):
        pictures = sorted(recording.parent.glob("*.png"))
        assert [picture.name for picture in pictures] == names
        text = (recording.parent / "report.md").read_text()
        assert [name for name in names if f"({name})" in text] == names
        assert all(picture.read_bytes().startswith(b"\x89PNG") for picture in pictures)


def test_the_curves_of_a_gripper_with_several_axes(plain: Path) -> None:
    """Each is a line with its name; nothing is drawn."""
    shown = {}
    for segment in segments(plain, tuple(pictures.PICTURES)):
        name, title, rows, curve = pictures.PICTURES[segment.stage]
        _, axes = pictures._figure(title, rows)
        assert curve(axes, segment)
        shown[name] = [[line.get_label() for line in axis.lines] for axis in axes]
        assert all(len(line.get_path()) > 1 for axis in axes for line in axis.lines)
    assert shown == {
        "activation.png": [["gACT", "gIMC", "gFLT"], ["A", "B", "C", "SCISSOR"]],
        "echo.png": [["gPRA", "gPOA", "written"], ["gDTA", "written"]],
        "strokes.png": [["speed 0", "speed 64", "speed 255"]],
    }


def test_the_picture_of_the_echo_shows_a_motion_from_rest(plain: Path) -> None:
    """Right after an activation every gDT is 0, as in a motion: such a motion would hide its lag."""
    (segment,) = segments(plain, (4,))
    motion = pictures._motion_from_rest(segment)
    assert motion is not None
    sent, axis = motion
    before = [status for seconds, status in segment.statuses if seconds < sent][-1]
    assert before.finger_status(axis) is ObjectStatus.AT_POSITION


def changed(source: Path, target: Path, change: Change) -> Path:
    """A copy of a recording in which each message has passed through a function."""
    with open(target, "wb") as file:
        writer = Writer(file)
        writer.start()
        channels: dict[str, int] = {}
        for entry in read_recording(source):
            if entry.topic not in channels:
                channels[entry.topic] = writer.register_channel(entry.topic, "json", 0)
            fields = json.loads(entry.data)
            change(entry.topic, fields)
            stamp = entry.nanoseconds
            writer.add_message(
                channels[entry.topic], stamp, json.dumps(fields).encode(), stamp, entry.sequence
            )
        writer.finish()  # type: ignore[no-untyped-call]
    return target


def test_a_recorded_simulation_differs_in_nothing(plain: Path, hardware_like: Path) -> None:
    assert hardware.main([str(plain), "--plain"]) == 0
    assert hardware.main([str(hardware_like)]) == 0


def test_habits_that_the_simulator_has_not_are_listed(hardware_like: Path) -> None:
    found = list(hardware.differences(str(hardware_like), Habits()))
    assert {"gDTA", "gFLT", "gPRA"} <= {each.field for each in found}
    assert {each.stage for each in found if each.field == "gFLT"} == {1}
    assert {each.stage for each in found if each.field == "gPRA"} == {2}


CHANGES = [
    (0, 0x0100, "gACT"),
    (0, 0x0800, "gGTO"),
    (0, 0x2000, "gIMC"),
    (0, 0x8000, "gSTA"),
    (0, 0x0002, "gDTA"),
    (0, 0x0080, "gDTS"),
    (1, 0x0A00, "gFLT"),
    (1, 0x0040, "gPRA"),
    (2, 0x4000, "gPOA"),
    (3, 0x0040, "gPOB"),
    (6, 0x4000, "gPRS"),
    (6, 0x0040, "gPOS"),
]
"""Register, bits, and the field that they are of."""
EVERY = 15
"""Statuses from one change to the next."""


def test_frames_that_were_changed_by_hand_are_listed_and_no_others(short: Path, tmp_path: Path) -> None:
    """Each in a status of its own, of a gripper that is reset: all in stage 2."""
    stage, seen = "", 0

    def change(topic: str, fields: dict[str, Any]) -> None:
        nonlocal stage, seen
        stage = fields.get("target") or stage
        if stage == "verify stage 2" and topic == "/gripper/status":
            number, rest = divmod(seen, EVERY)
            if rest == EVERY - 1 and number < len(CHANGES):
                register, bits, _ = CHANGES[number]
                fields["registers"][register] ^= bits
            seen += 1

    found = list(hardware.differences(str(changed(short, tmp_path / "changed.mcap", change)), Habits()))
    assert {each.stage for each in found} == {2}
    frames: dict[float, set[str]] = {}
    for each in found:
        frames.setdefault(each.seconds, set()).add(each.field)
    fields = [names - {"decoder"} for _, names in sorted(frames.items())]
    assert fields == [{name} for _, _, name in CHANGES]


def test_fields_that_decode_differently_are_listed(short: Path, tmp_path: Path) -> None:
    seen = [0]

    def change(topic: str, fields: dict[str, Any]) -> None:
        seen[0] += topic == "/gripper/status"
        if seen[0] == 100 and topic == "/gripper/status":
            fields["is_activated"] = not fields["is_activated"]

    found = list(hardware.differences(str(changed(short, tmp_path / "changed.mcap", change)), Habits()))
    assert [each.field for each in found] == ["decoder"]
