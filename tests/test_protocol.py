"""Hand: which classes satisfy it, and that the tools around a hand need nothing else."""

from __future__ import annotations

import ast
import asyncio
import inspect
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import pytest
from textual.widgets import RichLog, Static

import robotiq_async
from robotiq_async import (
    Fault,
    Finger,
    GripChange,
    RobotiqHand,
)
from robotiq_async.cli.output.tables import print_status
from robotiq_async.cli.tui.screen import Monitor
from robotiq_async.fleet import RemoteHand
from robotiq_async.hands import Backend, Hand
from robotiq_async.tools.actions import ACTIONS, Operator
from robotiq_async.tools.measure.campaigns import grasp, time_closing
from robotiq_async.tools.metrics import serve_metrics
from robotiq_async.tools.recording.payloads import reading_fields
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording
from tests.fake_hand import FakeHand
from tests.patience import patience

ROOT = Path(robotiq_async.__file__).parent
AROUND = [path for room in ("tools", "cli") for path in sorted((ROOT / room).rglob("*.py"))]
"""The packages around a hand."""


# -- who satisfies it --------------------------------------------------------------------------------------


def members(kind: type) -> dict[str, object]:
    own = {
        name for base in kind.__mro__ if base.__module__.startswith("robotiq_async") for name in vars(base)
    }
    return {name: getattr(kind, name) for name in own if not name.startswith("_")}


def test_every_hand_has_the_public_members_of_hand() -> None:
    """Except for members of the process that owns the link, and those that need a lease."""
    shared = members(Hand).keys()
    assert members(RobotiqHand).keys() - shared == {
        *("add_listener", "assume", "drop_requests", "halt_inhibited", "options", "resume_inhibit")
    }
    assert members(RemoteHand).keys() - shared == {"acquire", "take", "release", "is_in_control"}


@pytest.mark.parametrize("kind", [RobotiqHand, RemoteHand])
def test_a_kind_of_hand_leaves_checks_and_promises_to_hand(kind: type) -> None:
    """And a hand is one class, which has the backend of its kind: neither is cut into two by inheritance."""
    assert members(Hand).keys() & vars(kind).keys() == set()
    assert kind.__bases__ == (Hand,)
    assert Hand.__bases__ == (object,)
    assert inspect.isabstract(Backend)


# -- nothing looks further ---------------------------------------------------------------------------------


def names(path: Path, name: str) -> bool:
    """Whether a module uses or imports a name, and does not only speak of it."""
    text = path.read_text(encoding="utf-8")
    return name in text and name in names_in(text)


def names_in(text: str) -> Iterator[str]:
    for node in ast.walk(ast.parse(text)):
        if isinstance(node, ast.Name):
            yield node.id
        elif isinstance(node, ast.Import | ast.ImportFrom):
            yield from (alias.name for alias in node.names)


def test_tools_do_not_know_which_kind_of_hand_they_use() -> None:
    """Except for the one function that makes a hand from an address. The blocking hand has one kind."""
    tools = ROOT / "tools"
    blocking = [tools / "recording" / "recorder.py", tools / "service.py"]
    knowing = [path for path in AROUND if names(path, "RobotiqHand") and path not in blocking]
    assert knowing == [ROOT / "cli" / "connect.py"]


# -- and needs nothing else --------------------------------------------------------------------------------


@pytest.fixture
async def hand() -> AsyncIterator[FakeHand]:
    async with FakeHand() as hand:
        yield hand


async def test_everything_around_a_hand(
    hand: FakeHand, tmp_path: Path, capfd: pytest.CaptureFixture[str]
) -> None:
    """The calls that mypy checks, made once; the work of each tool has its own tests."""
    pytest.importorskip("foxglove")
    from robotiq_async.tools.viewer import Viewer  # noqa: PLC0415

    operator = Operator(hand)
    async with (
        Recorder(hand, tmp_path / "it.mcap") as recorder,
        Viewer(hand, port=0),
        serve_metrics(hand, port=0),
        Monitor(operator).run_test(size=(100, 30)) as pilot,
    ):
        assert await time_closing(hand, 255, Finger.ABC, speedup=1000.0) == 0.0
        hand.fake.obstacle = 150
        assert await grasp(hand, 64, 255, speedup=1000.0)
        await pilot.press("c")
        log = pilot.app.query_one("#log", RichLog)
        async with asyncio.timeout(patience(20)):
            while not any("close: A in contact at 150" in line.text for line in log.lines):
                await pilot.pause(0.02)
    hand.fake.fail(Fault.SCISSOR_BLOCKED)
    said = [await operator.act(ACTIONS[name]) for name in ("halt", "release", "recover", "reset", "activate")]
    assert said[-1] == "the gripper is active"
    assert "were stopped" in await operator.leave()
    assert len(list(read_recording(tmp_path / "it.mcap"))) > recorder.recorded > 0
    print_status(hand)
    assert capfd.readouterr().out.startswith("SHUTDOWN: active, not moving\n")
    assert reading_fields(hand)["state"] == "SHUTDOWN"


async def test_the_monitor_of_a_hand_with_a_name() -> None:
    async with FakeHand("left") as hand, Monitor(Operator(hand)).run_test(size=(100, 30)) as pilot:
        await pilot.pause()
        assert "  left (fake://hand)" in str(pilot.app.query_one("#state", Static).render())


async def test_a_grasp_and_its_events(hand: FakeHand) -> None:
    hand.fake.obstacle = 150
    grasp = await hand.grasp()
    assert grasp.holds == Finger.ABC
    assert hand.units.mm(grasp.positions[Finger.A]) == pytest.approx(60, abs=1)
    events = hand.grip_events(since=grasp.status)
    await hand.open(Finger.A)
    event = await anext(events)
    assert (event.change, event.finger, event.holds) == (GripChange.RELEASED, Finger.A, Finger.B | Finger.C)
