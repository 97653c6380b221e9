"""Ctrl-C, whenever it comes: the fingers stop, the command prints that in one line and ends with 130."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import subprocess
import sys
from asyncio.subprocess import Process
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

import pytest

from robotiq_async.cli.run import _EndingSignals
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.values.request import Request
from tests import conftest
from tests.forked import ROOT
from tests.grippers import active_gripper, until

if TYPE_CHECKING:
    from tests.cli.conftest import Shell

LINES = (1, 12, 40)
"""Lines of the demo's output after which Ctrl-C comes; they lie in all of its parts."""


def assert_fingers_stopped(server: SimulatorServer) -> None:
    assert not server.gripper.is_moving
    assert not Request.from_registers(server.gripper.request_registers).go


@pytest.fixture
def ignored() -> Iterator[None]:
    """Ignore Ctrl-C, as under nohup and in a job in the background."""
    before = [(number, signal.signal(number, signal.SIG_IGN)) for number in (signal.SIGHUP, signal.SIGINT)]
    yield
    for number, handler in before:
        signal.signal(number, handler)


@pytest.mark.usefixtures("ignored")
async def test_processes_started_by_tests_do_not_inherit_ignored_signals(shell: Shell) -> None:
    conftest.hear_ignored_signals()
    process = await shell.python("-c", "import signal; print(*map(signal.getsignal, (1, 2)), sep='\\n')")
    first, second = (await shell.finish(process)).out.splitlines()
    assert (first, "default_int_handler" in second) == (str(signal.SIG_DFL), True)
    os.kill(os.getpid(), signal.SIGHUP)  # ends no test


async def interrupted(shell: Shell, process: Process) -> str:
    """Press Ctrl-C and see it end; returns what else it printed."""
    process.send_signal(signal.SIGINT)
    outcome = await shell.finish(process)
    outcome.assert_failed(130, "interrupted")
    return outcome.out


@pytest.mark.parametrize("command", [["demo", "--yes"], ["simulate"]])
async def test_while_it_is_still_importing(shell: Shell, command: list[str]) -> None:
    process = await shell.python("-X", "importtime", "-m", "robotiq_async", *command)
    assert process.stderr is not None
    async for line in process.stderr:
        if b"| " in line and line.split()[-1].startswith(b"cyclopts"):
            break
    process.send_signal(signal.SIGINT)
    outcome = await shell.finish(process)
    lines = [line for line in outcome.err.splitlines() if not line.startswith("import time:")]
    assert (outcome.code, lines) == (130, ["robotiq-async: interrupted"])


def test_inside_the_exec_of_an_import(tmp_path: Path) -> None:
    """Dataclasses are made with one; CPython then ended the process by the signal."""
    (tmp_path / "cyclopts.py").write_text('exec("raise KeyboardInterrupt")\n', encoding="utf-8")
    environment = os.environ | {"PYTHONPATH": f"{tmp_path}{os.pathsep}{ROOT}"}
    command = [sys.executable, "-m", "robotiq_async", "simulate"]
    done = subprocess.run(command, env=environment, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stderr) == (130, "robotiq-async: interrupted\n")


@pytest.mark.parametrize("lines", LINES)
async def test_the_demo(shell: Shell, lines: int) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=10)) as server:
        process = await shell.start("demo", "--yes", server.address)
        for _ in range(lines):
            assert await shell.read_line(process) is not None
        await interrupted(shell, process)
        assert_fingers_stopped(server)


async def test_a_move_in_its_activation(shell: Shell) -> None:
    async with SimulatorServer(SimulatedGripper(speedup=2)) as server:
        process = await shell.start("move", "255", "--yes", server.address)
        await until(lambda: server.gripper.is_moving, within=30)
        await interrupted(shell, process)
        assert not server.gripper.is_moving
        assert not Request.from_registers(server.gripper.request_registers).activate


async def test_further_signals_do_not_keep_the_first_from_stopping_the_fingers(shell: Shell) -> None:
    """A third Ctrl-C within half a second broke the event loop, and the fingers moved on."""
    async with SimulatorServer(active_gripper(speedup=1)) as server:
        await server.fault_injector.begin(Trouble("delay", 0.3))
        process = await shell.start("move", "255", "--speed", "0", "--yes", server.address)
        await until(lambda: server.gripper.is_moving, within=30)
        for _ in range(4):
            process.send_signal(signal.SIGINT)
            await asyncio.sleep(0.1)  # as fast as a person presses keys
        (await shell.finish(process)).assert_failed(130, "interrupted")
        assert_fingers_stopped(server)


def test_a_late_ctrl_c_ends_a_command_that_does_not_end() -> None:
    async def deaf() -> None:
        for _ in range(2):
            os.kill(os.getpid(), signal.SIGINT)
            with contextlib.suppress(asyncio.CancelledError):
                await asyncio.sleep(60)

    with _EndingSignals(insist_s=0.0) as signals, pytest.raises(KeyboardInterrupt):
        signals.run(deaf())


ASLEEP = """
import signal, sys, threading, time
threading.Thread(target=time.sleep, args=(60,), daemon=True).start()
signal.pthread_sigmask(signal.SIG_BLOCK, [signal.SIGTERM])
from robotiq_async.cli import main
sys.exit(main(["simulate", "--port", "0"]))
"""
"""The signal goes to the other thread; the loop's own sleeps on, as when it comes while it falls asleep."""


async def test_a_signal_wakes_an_idle_loop(shell: Shell) -> None:
    process = await shell.forked("-c", ASLEEP)
    assert (await shell.read_line(process)).startswith("tcp://")
    process.send_signal(signal.SIGTERM)
    assert (await shell.finish(process)).code == 0
