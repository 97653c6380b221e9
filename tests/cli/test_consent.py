"""Commands that move a gripper ask at a terminal, and without one need --yes."""

from __future__ import annotations

import inspect
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli.app import SUBCOMMANDS
from robotiq_async.cli.commands.measure import speed
from robotiq_async.cli.commands.measure_force import force
from robotiq_async.cli.commands.measure_stroke import stroke
from robotiq_async.cli.commands.verify import verify
from robotiq_async.simulator import SimulatorServer
from tests.cli.conftest import CLOSED, FORGETTING
from tests.cli.terminal import Terminal
from tests.forked import ROOT

if TYPE_CHECKING:
    from tests.cli.conftest import Call, Shell

COMMAND_LINE = ("-m", "robotiq_async")
PROGRAM = (str(ROOT / "demo" / "demo.py"),)
MOVING = {
    "move": (*COMMAND_LINE, "move", "255"),
    "demo": (*COMMAND_LINE, "demo"),
    "demo.py": PROGRAM,
    "measure speed": (*COMMAND_LINE, "measure", "speed", "--no-plot"),
    "measure force": (*COMMAND_LINE, "measure", "force", "--no-plot"),
}
NO_GRIPPER = "tcp://127.0.0.1:1"
"""A command that connects to it ends with 1."""
ELSEWHERE = """
import os, sys
os.dup2(os.open({!r}, os.O_WRONLY | os.O_CREAT), {})
from robotiq_async.cli import main
sys.exit(main(["move", "30", {!r}]))
"""
"""A command whose output goes into a file."""
UNINTERRUPTED = """
import signal, sys, threading, time
threading.Thread(target=time.sleep, args=[60], daemon=True).start()
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGINT])
from robotiq_async.cli import main
sys.exit(main(["move", "30", {!r}]))
"""
"""A command with two threads: the system hands SIGINT to the other one, so that no read is interrupted."""


@pytest.fixture
def file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """The name of a file that a command would write, in the folder that it runs in."""
    monkeypatch.chdir(tmp_path)
    return tmp_path / "out.txt"


def written(file: Path) -> str:
    return file.read_text(encoding="utf-8")


# -- no person to ask --------------------------------------------------------------------------------------


@pytest.mark.parametrize("command", [each for each in MOVING if each != "demo.py"])
def test_without_a_terminal_nothing_is_sent(call: Call, file: Path, command: str) -> None:
    outcome = call(*MOVING[command][len(COMMAND_LINE) :], NO_GRIPPER, stdin=b"y\n")
    outcome.assert_failed(2, "--yes", NO_GRIPPER)
    assert outcome.out == ""
    assert list(file.parent.iterdir()) == []


@pytest.mark.parametrize("closed", [0, 1])
async def test_a_stream_that_is_closed_is_no_terminal(
    shell: Shell, server: SimulatorServer, closed: int
) -> None:
    process = await shell.forked("-c", CLOSED.format(closed, ["move", "30", server.address]))
    outcome = await shell.finish(process)
    outcome.assert_failed(2, "--yes")
    assert not server.gripper.writes


@pytest.mark.usefixtures("virtually")
def test_a_simulated_gripper_inside_the_program_needs_no_consent(call: Call) -> None:
    outcome = call("move", "10", "sim://")
    outcome.assert_succeeded()
    assert "[y/N]" not in outcome.out


# -- a person to ask ---------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("command", "answer"),
    [(each, "n\n") for each in MOVING] + [("move", each) for each in ("\n", "\x04", "\udcff\n")],
)
async def test_at_a_terminal_nothing_happens_without_a_yes(
    server: SimulatorServer, file: Path, command: str, answer: str
) -> None:
    terminal = Terminal(*MOVING[command], server.address)
    await terminal.shows(b"Continue? [y/N]")
    assert server.address.encode() in terminal.out
    assert b"emergency stop" in terminal.out
    terminal.press(answer)
    assert await terminal.end() == 1
    assert b"nothing was sent" in terminal.out
    assert b"Traceback" not in terminal.out
    assert not server.gripper.writes
    assert list(file.parent.iterdir()) == []


@pytest.mark.parametrize(("model", "axes"), [("3f", b"ABC"), ("hand-e", b"jaw")])
async def test_the_question_names_the_axes_of_the_model(
    server: SimulatorServer, model: str, axes: bytes
) -> None:
    terminal = Terminal(*COMMAND_LINE, "move", "30", f"{server.address}?model={model}")
    await terminal.shows(b"Continue? [y/N]")
    terminal.press("n\n")
    assert await terminal.end() == 1
    assert b"this MOVES %b to 30." % axes in terminal.out


@pytest.mark.parametrize(
    ("before", "answer", "code"), [("", "y\n", 0), ("", " YES \n", 0), ("y\n", "n\n", 1), ("", "\x03", 130)]
)
async def test_only_a_yes_to_the_question_moves(
    server: SimulatorServer, before: str, answer: str, code: int
) -> None:
    """Keys typed before it are no answer, and Ctrl-C is no yes."""
    terminal = Terminal(*COMMAND_LINE, "move", "30", server.address)
    terminal.press(before)
    await terminal.shows(b"Continue? [y/N]")
    terminal.press(answer)
    assert await terminal.end() == code
    assert (b"AT_POSITION" in terminal.out, bool(server.gripper.writes)) == (code == 0, code == 0)


async def test_ctrl_c_ends_the_question_though_it_interrupts_no_read(server: SimulatorServer) -> None:
    terminal = Terminal("-c", UNINTERRUPTED.format(server.address))
    await terminal.shows(b"Continue? [y/N]")
    terminal.press("\x03")
    assert await terminal.end() == 130
    assert not server.gripper.writes


@pytest.mark.parametrize("elsewhere", [1, 2])
async def test_the_question_is_where_it_is_seen(server: SimulatorServer, file: Path, elsewhere: int) -> None:
    terminal = Terminal("-c", ELSEWHERE.format(str(file), elsewhere, server.address))
    await terminal.shows(b"Continue? [y/N]")
    terminal.press("y\n")
    assert await terminal.end() == 0
    assert "[y/N]" not in written(file)
    assert server.gripper.writes


@pytest.mark.usefixtures("virtually")
def test_nothing_is_asked_when_there_is_nothing_left_to_measure(call: Call, file: Path) -> None:
    """The table is of a simulated gripper, measured in virtual time, and says that it is of a real one."""
    options = ("--output", "t.csv", "--step", "255", "--runs", "1", "--no-plot")
    call("measure", "speed", "sim://", "--speedup", "30", *options).assert_succeeded()
    origin = file.with_name("t.csv.origin.csv")
    origin.write_text(written(origin).replace("sim://", NO_GRIPPER), encoding="utf-8")
    outcome = call("measure", "speed", NO_GRIPPER, *options)
    outcome.assert_succeeded()
    assert "is complete: nothing is measured again" in outcome.out


# -- every command -----------------------------------------------------------------------------------------


def test_every_command_that_moves_takes_yes() -> None:
    commands: list[Callable[..., object]] = [*SUBCOMMANDS, speed, force, stroke]
    moving = {each for each in commands if "FINGERS MOVE" in (each.__doc__ or "")}
    assert {each.__name__ for each in moving} == {"demo", "move", "speed", "force", "stroke", "verify"}
    # verify asks before each stage that moves, and takes no consent to one beforehand.
    assert {each for each in commands if "yes" in inspect.signature(each).parameters} == moving - {verify}


def test_commands_that_do_not_move_write_nothing(call: Call, there: SimulatorServer, file: Path) -> None:
    call("move", "50", "--yes", there.address).assert_succeeded()
    writes = len(there.gripper.writes)
    for command in (["status"], ["status", "--json"], ["doctor"], ["record", str(file), "--seconds", "0.2"]):
        assert call(*command, there.address).out
    assert len(there.gripper.writes) == writes


async def test_the_demo_asks_without_the_extra_too(shell: Shell, server: SimulatorServer) -> None:
    code = f"import runpy, sys; sys.modules['cyclopts'] = None; sys.argv[1:] = [{server.address!r}]"
    program = f"{FORGETTING}{code}\nrunpy.run_path({PROGRAM[0]!r}, run_name='__main__')"
    outcome = await shell.finish(await shell.forked("-c", program))
    assert outcome.code == 2
    assert outcome.err.startswith("demo: ")
    assert "--yes" in outcome.err
    assert not server.gripper.writes
