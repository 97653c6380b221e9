"""The command line as a user runs it: in a process of its own."""

from __future__ import annotations

import asyncio
import contextlib
import os
import signal
import sys
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator, Iterator
from dataclasses import dataclass, field

import pytest

from tests.cli.terminal import ROOT, Terminal

WITHOUT = """
import importlib.util, sys
find = importlib.util.find_spec
importlib.util.find_spec = lambda name, *rest: None if name == "{}" else find(name, *rest)
from robotiq_async.cli import main
sys.exit(main({}))
"""
"""A command line that does not find a module."""
PATIENCE = 30.0
"""Seconds after which a command counts as hanging."""


@dataclass(frozen=True)
class Outcome:
    """How a command ended."""

    code: int
    out: str
    err: str

    def assert_succeeded(self) -> None:
        """It ended with 0; on a busy machine the library may have remarked on late polls."""
        assert self.code == 0, self.err
        assert "Traceback" not in self.err

    def assert_failed(self, code: int, *words: str) -> None:
        """It ended with this code and exactly one line on stderr, in which these words occur."""
        assert (self.code, self.err.count("\n")) == (code, 1), self.err
        assert self.err.startswith("robotiq-async: ")
        assert "Traceback" not in self.err
        for word in words:
            assert word in self.err


@dataclass
class Shell:
    """Starts commands; those that still run at the end of the test are killed."""

    processes: list[Process] = field(default_factory=list)

    async def run(self, *arguments: str) -> Outcome:
        """Run a command to its end."""
        return await self.finish(await self.start(*arguments))

    async def start(self, *arguments: str, stdin: int = DEVNULL) -> Process:
        """Start a command."""
        return await self.python("-m", "robotiq_async", *arguments, stdin=stdin)

    async def python(self, *arguments: str, stdin: int = DEVNULL) -> Process:
        """Start this interpreter."""
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        process = await asyncio.create_subprocess_exec(
            sys.executable, *arguments, stdin=stdin, stdout=PIPE, stderr=PIPE, env=environment
        )
        self.processes.append(process)
        return process

    async def finish(self, process: Process) -> Outcome:
        """Wait until a command has ended."""
        async with asyncio.timeout(PATIENCE):
            out, err = await process.communicate()
        assert process.returncode is not None
        return Outcome(process.returncode, out.decode(), err.decode())

    async def read_line(self, process: Process) -> str:
        """The next line of its standard output, which is empty when it has ended."""
        assert process.stdout is not None
        async with asyncio.timeout(PATIENCE):
            return (await process.stdout.readline()).decode().rstrip("\n")


@pytest.fixture
async def shell() -> AsyncIterator[Shell]:
    shell = Shell()
    yield shell
    for process in shell.processes:
        with contextlib.suppress(ProcessLookupError):
            process.kill()
        await process.communicate()


@pytest.fixture(autouse=True)
def no_terminal_is_left() -> Iterator[None]:
    yield
    for process in Terminal.running:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
    Terminal.running.clear()
