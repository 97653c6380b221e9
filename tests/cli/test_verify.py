"""``robotiq-async verify``: its questions, and the effect of keys while fingers move."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator, Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli.keyboard import AGREE, PROMPT, wrapped
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.verify.stages import STAGES
from robotiq_async.values.registers import rACT, rGTO
from tests.cli.conftest import WITHOUT
from tests.cli.terminal import Terminal
from tests.grippers import until

if TYPE_CHECKING:
    from tests.cli.conftest import Call


def test_without_the_extra_nothing_is_sent(
    call: Call, there: SimulatorServer, monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    monkeypatch.setattr("robotiq_async.cli.arguments.find_spec", lambda _: None)
    arguments = ("--up-to", "2", "--yes-to", "2", "--report", str(tmp_path / "report"))
    call("verify", there.address, *arguments).assert_failed(1, "mcap", "extra record")
    assert not there.gripper.writes
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_refused_before_anything_is_sent(
    call: Call, there: SimulatorServer, tmp_path: Path
) -> None:
    (tmp_path / "file").write_text("")
    where = str(tmp_path / "file" / "report")
    outcome = call("verify", there.address, "--up-to", "2", "--yes-to", "2", "--report", where)
    outcome.assert_failed(1, "nothing was sent")
    assert not there.gripper.writes


def test_no_answer_gives_one_line_and_a_report(call: Call, tmp_path: Path) -> None:
    where = tmp_path / "report"
    outcome = call("verify", "127.0.0.1:1", "--up-to", "2", "--yes-to", "2", "--report", str(where))
    outcome.assert_failed(1, "refused")
    assert "could not be judged" in outcome.out
    assert {path.name for path in where.iterdir()} == {"report.json", "report.md", "recording.mcap"}


def test_stages_that_move_nothing_run_without_a_person(call: Call, tmp_path: Path) -> None:
    """Against the gripper of sim://."""
    outcome = call("verify", "sim://", "--up-to", "0", "--yes-to", "0", "--report", str(tmp_path / "report"))
    outcome.assert_succeeded()
    assert "Nothing is known about the gripper yet" in outcome.out


def test_it_takes_the_model_as_an_option(call: Call, tmp_path: Path) -> None:
    where = tmp_path / "report"
    arguments = ("--model", "2f85", "--up-to", "0", "--yes-to", "0", "--report", str(where))
    call("verify", "sim://", *arguments).assert_succeeded()
    assert "Checked as a 2F-85" in (where / "report.md").read_text()
    assert 'model="2f85"' in (where / "report.md").read_text()


@pytest.mark.parametrize("columns", [40, 60, 100])
@pytest.mark.parametrize("stage", STAGES, ids=lambda stage: str(stage.number))
def test_a_stage_is_described_within_the_width_of_the_terminal(stage: object, columns: int) -> None:
    text = wrapped(f"{stage.as_text()}\n{AGREE}", columns)  # type: ignore[attr-defined]
    assert all(len(line) < columns for line in text.splitlines())
    assert text.split() == f"{stage.as_text()}\n{AGREE}".split()  # type: ignore[attr-defined]


def test_a_stage_that_moves_says_how_far_how_fast_and_what_must_be_clear() -> None:
    for stage in STAGES:
        assert stage.moves
        assert stage.lasts
        if stage.is_moving:
            assert stage.how_far
            assert stage.how_fast
            assert stage.clear
    assert [stage.number for stage in STAGES if stage.is_moving] == list(range(3, 10))


# -- at a terminal -----------------------------------------------------------------------------------------


@pytest.fixture
async def served() -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(SimulatedGripper()) as server:
        yield server


async def asks(terminal: Terminal, words: bytes) -> None:
    """Wait for a question, and until it takes an answer."""
    await terminal.shows(words)
    await terminal.shows(PROMPT.encode(), after=words)


def at_terminal(server: SimulatorServer, folder: Path, *arguments: str) -> Terminal:
    """Without matplotlib: its pictures, which tests/verify looks at, take longer than the run."""
    command = ["verify", server.address, *arguments, "--report", str(folder / "report")]
    return Terminal("-c", WITHOUT.format("matplotlib", command))


async def moves(server: SimulatorServer, folder: Path) -> Terminal:
    """The terminal of a command whose third stage moves the fingers."""
    terminal = at_terminal(server, folder, "--from", "3", "--up-to", "3")
    await asks(terminal, b"Stage 3")
    terminal.press("\n")
    await until(lambda: server.gripper.is_moving)
    return terminal


async def stood(server: SimulatorServer) -> None:
    """The fingers stand, in a moment, and what was written last stops them."""
    await until(lambda: not server.gripper.is_moving, within=2)
    image = server.gripper.writes[-1].registers
    assert not rGTO.read(image)
    assert not rACT.read(image)


async def test_enter_begins_and_any_other_key_ends(served: SimulatorServer, tmp_path: Path) -> None:
    terminal = at_terminal(served, tmp_path, "--up-to", "1")
    await asks(terminal, b"Stage 0")
    terminal.press("\n")
    await asks(terminal, b"Stage 1")
    terminal.press("y")
    assert await terminal.end() == 1
    assert b"declined" in terminal.out
    assert (tmp_path / "report" / "report.md").exists()
    assert not served.gripper.writes


async def test_keys_typed_before_the_question_do_not_answer_it(
    served: SimulatorServer, tmp_path: Path
) -> None:
    terminal = at_terminal(served, tmp_path, "--from", "3", "--up-to", "3")
    await terminal.shows(b"Gripper tcp")
    terminal.press("\n\n\n")
    await asks(terminal, b"Stage 3")
    await asyncio.sleep(0.5)
    assert not served.gripper.writes
    terminal.press("n")
    assert await terminal.end() == 1


async def test_a_key_that_answers_no_question_is_refused(tmp_path: Path) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=50)) as server:
        terminal = at_terminal(server, tmp_path, "--from", "3", "--up-to", "4")
        for stage in (b"Stage 3", b"Stage 4"):
            await asks(terminal, stage)
            terminal.press("\n")
        await asks(terminal, b"Which finger")
        terminal.press("p")
        await asks(terminal, b"Please press one of a, l, r, s, n, q")
        terminal.press("q")
        assert await terminal.end() == 1
        assert b"declined" in terminal.out


KEYS: dict[str, tuple[int, Callable[[Terminal], object]]] = {
    "space": (1, lambda terminal: terminal.press(" ")),
    "Ctrl-Z": (1, lambda terminal: terminal.press("\x1a")),
    "Ctrl-S": (1, lambda terminal: terminal.press("\x13")),
    "Ctrl-C, again and again": (130, lambda terminal: terminal.press("\x03" * 5)),
    "SIGTERM": (143, lambda terminal: terminal.kill(signal.SIGTERM)),
    "closed": (129, lambda terminal: terminal.hang_up()),
}
"""Each with the exit code; of keys one for each flag of a terminal (ICANON, ISIG, IXON)."""


@pytest.mark.parametrize("key", KEYS)
async def test_every_key_that_interrupts_stops_the_fingers(
    served: SimulatorServer, tmp_path: Path, key: str
) -> None:
    terminal = await moves(served, tmp_path)
    code, press = KEYS[key]
    press(terminal)
    await stood(served)
    assert await terminal.end() == code
    text = (tmp_path / "report" / "report.json").read_text()
    assert '"why": "interrupted"' in text or '"why": "stopped"' in text
    if key.startswith("Ctrl-C"):
        assert f"interrupted: the report is in {tmp_path / 'report'}" in terminal.out.decode()


async def test_a_terminal_that_shows_nothing_does_not_keep_the_fingers_moving(
    served: SimulatorServer, tmp_path: Path
) -> None:
    """It happens after Ctrl-S somewhere on the way, or over a network that stands still."""
    terminal = await moves(served, tmp_path)
    terminal.stop_reading()
    terminal.press("x")
    await stood(served)
    terminal.read_on()
    assert await terminal.end() == 1
