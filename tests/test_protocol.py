"""Hand: which classes satisfy it, and that the tools around a hand need nothing else."""

from __future__ import annotations

import ast
import asyncio
import inspect
import json
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from textual.widgets import RichLog, Static

import robotiq_async
from robotiq_async import (
    Fault,
    Finger,
    GripChange,
    InvalidStateError,
    RobotiqHand,
    State,
)
from robotiq_async.cli.output.lines import print_objects
from robotiq_async.cli.output.tables import print_outcomes, print_status
from robotiq_async.cli.tui.screen import Monitor
from robotiq_async.fleet import RemoteHand
from robotiq_async.hand import Hand
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.tools.measure.campaigns import grasp, time_closing
from robotiq_async.tools.metrics import serve_metrics
from robotiq_async.tools.recording.payloads import reading_fields
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording
from robotiq_async.values.errors import MeasuringError
from tests.fake_hand import FakeHand

ROOT = Path(robotiq_async.__file__).parent
AROUND = [path for room in ("tools", "cli") for path in sorted((ROOT / room).rglob("*.py"))]
"""What stands around a hand."""


# -- who satisfies it --------------------------------------------------------------------------------------


def members(kind: type) -> dict[str, object]:
    own = {
        name for base in kind.__mro__ if base.__module__.startswith("robotiq_async") for name in vars(base)
    }
    return {name: getattr(kind, name) for name in own if not name.startswith("_")}


def test_what_is_public_at_a_hand_every_hand_has() -> None:
    """But for what belongs to the process that owns the link, and what takes a lease."""
    shared = members(Hand).keys()
    assert members(RobotiqHand).keys() - shared == {"add_listener"}
    assert members(RemoteHand).keys() - shared == {"acquire", "take", "release", "is_in_control"}


@pytest.mark.parametrize("kind", [RobotiqHand, RemoteHand])
def test_a_kind_of_hand_leaves_checks_and_promises_to_hand(kind: type) -> None:
    supplied = {"state", "statistics"}
    assert members(Hand).keys() & vars(kind).keys() == supplied
    assert inspect.isabstract(Hand)


# -- nothing looks further ---------------------------------------------------------------------------------


def names_in(path: Path) -> Iterator[str]:
    for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from (alias.name for alias in node.names)


def test_what_stands_around_a_hand_does_not_know_which_one() -> None:
    """But for the one function that makes a hand from an address."""
    assert [path for path in AROUND if "RobotiqHand" in names_in(path)] == [ROOT / "cli" / "connect.py"]


# -- and needs nothing else --------------------------------------------------------------------------------


@pytest.fixture
async def hand() -> AsyncIterator[FakeHand]:
    async with FakeHand() as hand:
        yield hand


async def test_actions(hand: FakeHand) -> None:
    operator = Operator(hand)
    hand.obstacle = 150
    assert await operator.act(ACTIONS["wide"]) == "SCISSOR at 6; 0.00 s"
    assert (await operator.act(ACTIONS["close"])).startswith("A in contact at 150, B ")
    assert await operator.change_speed(16) == "144"
    assert await operator.act(ACTIONS["halt"]) == "every axis has stopped"
    with pytest.raises(InvalidStateError):
        await operator.act(ACTIONS["release"])
    hand.fail(Fault.SCISSOR_BLOCKED)
    assert await operator.act(ACTIONS["release"]) == "released; only a reset helps now"
    assert await operator.act(ACTIONS["recover"]) == "the gripper is active"
    assert await operator.act(ACTIONS["reset"]) == "the gripper is reset"
    assert await operator.act(ACTIONS["activate"]) == "the gripper is active"
    assert operator.has_moved
    assert "were stopped" in await operator.leave()


async def test_whoever_has_only_looked_leaves_the_fingers_alone(hand: FakeHand) -> None:
    assert "left as they are" in await Operator(hand).leave()
    assert hand.status.go_echo


async def test_a_recording(tmp_path: Path) -> None:
    hand = FakeHand()
    async with Recorder(hand, tmp_path / "it.mcap") as recorder, hand:
        await hand.set_force(200, Finger.B)
        hand.fail(Fault.SCISSOR_BLOCKED)
    entries = list(read_recording(tmp_path / "it.mcap"))
    polls = [entry.sequence for entry in entries if entry.topic == "/gripper/status"]
    assert polls == list(range(hand.statistics.polls))
    assert (recorder.recorded, recorder.missed) == (len(polls), 0)
    commands = [entry.fields for entry in entries if entry.topic == "/gripper/command"]
    assert commands[0]["B"]["force"] == 200
    events = [entry.fields for entry in entries if entry.topic == "/gripper/event"]
    assert events[0] | {"timestamp": 0} == {"kind": "state", "target": "DISCONNECTED", "timestamp": 0}
    assert [event["fault_code"] for event in events if event["kind"] == "fault"] == [14]
    assert events[-1]["target"] == "SHUTDOWN"


async def test_a_viewer(hand: FakeHand) -> None:
    pytest.importorskip("foxglove")
    from robotiq_async.tools.viewer import Viewer  # noqa: PLC0415
    from tests.foxglove_client import client  # noqa: PLC0415

    async with Viewer(hand, port=0) as viewer, client(viewer) as one:
        await one.subscribe("/gripper/status", "/gripper/state")
        await hand.move(77, Finger.B)
        while not any(status["B"]["position"] == 77 for status in one.objects("/gripper/status")):
            await one.read()
        while not one.objects("/gripper/state"):
            await one.read()
        assert one.objects("/gripper/state")[0]["address"] == hand.address


async def test_metrics(hand: FakeHand) -> None:
    async with serve_metrics(hand, port=0) as (host, port):
        reader, writer = await asyncio.open_connection(host, port)
        writer.write(b"GET /metrics HTTP/1.0\r\n\r\n")
        page = (await reader.read()).decode()
        writer.close()
        await writer.wait_closed()
    assert f'robotiq_polls_total{{hand="{hand.address}"}} 1.0' in page
    assert f'robotiq_state{{hand="{hand.address}",state="RUNNING_IDLE"}} 1.0' in page


async def test_the_monitor(hand: FakeHand) -> None:
    hand.obstacle = 150
    async with Monitor(Operator(hand)).run_test(size=(100, 30)) as pilot:
        await pilot.press("c")
        log = pilot.app.query_one("#log", RichLog)
        async with asyncio.timeout(20):
            while not any("close: A in contact at 150" in line.text for line in log.lines):
                await pilot.pause(0.02)
        assert f"  {hand.address}" in str(pilot.app.query_one("#state", Static).render())


async def test_the_monitor_of_a_hand_with_a_name() -> None:
    async with FakeHand("left") as hand, Monitor(Operator(hand)).run_test(size=(100, 30)) as pilot:
        await pilot.pause()
        assert "  left (fake://hand)" in str(pilot.app.query_one("#state", Static).render())


async def test_what_is_printed(hand: FakeHand, capfd: pytest.CaptureFixture[str]) -> None:
    print_outcomes(await hand.move(90, Finger.C))
    print_status(hand)
    assert reading_fields(hand)["state"] == "RUNNING_IDLE"
    printing = asyncio.create_task(print_objects(hand))
    await asyncio.sleep(0)  # begun
    await hand.move(100, Finger.A)
    await hand.stop()
    async with asyncio.timeout(5):
        await printing
    lines = capfd.readouterr().out.splitlines()
    told = [json.loads(line) for line in lines if line.startswith("{")]
    assert any(each["kind"] == "status" and each["A"]["position"] == 100 for each in told)
    assert told[-1]["state"] == "SHUTDOWN"
    assert "RUNNING_IDLE: active, not moving" in lines


async def test_a_grasp_and_what_becomes_of_it(hand: FakeHand) -> None:
    hand.obstacle = 150
    grasp = await hand.grasp()
    assert grasp.holds == Finger.ABC
    assert hand.units.mm(grasp.positions[Finger.A]) == pytest.approx(60, abs=1)
    events = hand.grip_events(since=grasp.status)
    await hand.open(Finger.A)
    event = await anext(events)
    assert (event.change, event.finger, event.holds) == (GripChange.RELEASED, Finger.A, Finger.B | Finger.C)


async def test_measurements(hand: FakeHand) -> None:
    assert await time_closing(hand, 255, Finger.ABC, speedup=1000.0) == 0.0
    hand.obstacle = 150
    with pytest.raises(MeasuringError, match="met something"):
        await time_closing(hand, 255, Finger.ABC, speedup=1000.0)
    samples = await grasp(hand, 64, 255, speedup=1000.0)
    assert {sample[1:] for sample in samples} == {(0, 0, 0)}
    assert hand.state is State.RUNNING_IDLE
