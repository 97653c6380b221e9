"""The command line as a user runs it: in this process (`call`), and in one of its own (`shell`, `beside`).

A process takes half a second of a CPU to start, and a tenth where it is forked (tests/forked.py). It is
for what needs one: signals, terminals, streams that are closed, what happens at an import, a second program
that runs at the same time, and once for each command.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import signal
import socket
import subprocess
import sys
import tempfile
import threading
import time
import warnings
from asyncio.subprocess import DEVNULL, PIPE, Process
from collections.abc import AsyncIterator, Callable, Coroutine, Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest
from mcap.writer import Writer

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.cli import main
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.recording.recorder import Recorder
from tests.cli.terminal import Terminal
from tests.forked import ROOT, forking
from tests.patience import patience
from tests.virtual import VirtualLoop

WITHOUT = """
import sys
missing = "{}"
for name in [each for each in sys.modules if each.startswith(missing + ".")]:
    sys.modules[name] = None
sys.modules[missing] = None
from robotiq_async.cli import main
sys.exit(main({}))
"""
"""A command line that does not find a module."""
FORGETTING = """
import sys
for name in [each for each in sys.modules if each.startswith("robotiq_async.cli")]:
    del sys.modules[name]
"""
"""Makes a forked process forget the command line, so that it imports it itself."""
CLOSED = """
import os, sys
os.close({0})
setattr(sys, ("stdin", "stdout", "stderr")[{0}], None)
from robotiq_async.cli import main
sys.exit(main({1}))
"""
"""A command line with a closed stream: the interpreter has None for one that is closed when it starts."""
PATIENCE = 30.0
"""Seconds after which a command counts as hanging."""


@dataclass(frozen=True)
class Outcome:
    """The end of a command."""

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


# -- in this process ---------------------------------------------------------------------------------------


def _environs() -> dict[str, object]:
    """The environment that a command may change in its process while it runs, and no longer."""
    loggers = [logging.getLogger(name) for name in ("", "robotiq_async", "foxglove", "asyncio", "pymodbus")]
    return {
        "signal handlers": {number: signal.getsignal(number) for number in signal.valid_signals()},
        "log handlers": [(logger.handlers[:], logger.level) for logger in loggers],
        "streams": (sys.stdin, sys.stdout, sys.stderr),
    }


def _end_threads(before: set[threading.Thread]) -> None:
    """Fail when there are more threads than before, and do not end soon either."""
    for thread in set(threading.enumerate()) - before:
        thread.join(patience(2))
        assert not thread.is_alive(), f"left running: {thread}"


@dataclass
class Call:
    """Runs commands in this process, as if nothing else were in it; they must leave it as they found it."""

    _capfd: pytest.CaptureFixture[str]

    def __call__(self, *arguments: str, stdin: bytes = b"") -> Outcome:
        """Run a command to its end; what it reads is no terminal, and neither is where it writes."""
        self._capfd.readouterr()
        with ExitStack() as stack:
            file = stack.enter_context(tempfile.TemporaryFile())
            file.write(stdin)
            file.seek(0)
            before = sys.stdin
            sys.stdin = stack.enter_context(open(file.fileno(), encoding="utf-8", closefd=False))
            stack.callback(setattr, sys, "stdin", before)
            # Pytest's: without them the log goes where a process has it.
            root = logging.getLogger()
            handlers, root.handlers = root.handlers, []
            stack.callback(setattr, root, "handlers", handlers)
            # One that hangs is interrupted, and ends with 130.
            impatience = threading.Timer(patience(PATIENCE), os.kill, (os.getpid(), signal.SIGINT))
            impatience.start()
            stack.callback(impatience.join)
            stack.callback(impatience.cancel)
            environs, filters, threads = _environs(), warnings.filters[:], set(threading.enumerate())
            code = main(arguments)
            _end_threads(threads)
            assert _environs() == environs
            # Those that came to it are of modules that were imported: numpy has some.
            assert [each for each in warnings.filters if each in filters] == filters
            assert signal.set_wakeup_fd(-1) == -1
        out, err = self._capfd.readouterr()
        return Outcome(code, out, err)


@pytest.fixture
def call(capfd: pytest.CaptureFixture[str]) -> Call:
    return Call(capfd)


@pytest.fixture
def without(monkeypatch: pytest.MonkeyPatch) -> Callable[[str], None]:
    """Lets a module be missing."""

    def miss(module: str) -> None:
        monkeypatch.setitem(sys.modules, module, None)

    return miss


@pytest.fixture
def refusing() -> Iterator[str]:
    """An address that refuses connections: bound, not listening, so that no other program gets the port."""
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        yield f"127.0.0.1:{reserved.getsockname()[1]}"


@contextmanager
def served(gripper: SimulatedGripper) -> Iterator[SimulatorServer]:
    """Serve a gripper from a thread, to what is called in this one."""
    server = SimulatorServer(gripper)
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    try:
        asyncio.run_coroutine_threadsafe(server.start(), loop).result(patience(PATIENCE))
        try:
            yield server
        finally:
            asyncio.run_coroutine_threadsafe(server.stop(), loop).result(patience(PATIENCE))
    finally:
        loop.call_soon_threadsafe(loop.stop)
        thread.join()
        left = asyncio.all_tasks(loop)
        loop.close()
    assert not left, f"tasks left running: {left}"


@pytest.fixture
def there() -> Iterator[SimulatorServer]:
    """A fast gripper for what is called."""
    with served(SimulatedGripper(speedup=20)) as server:
        yield server


class _LoneLoop(VirtualLoop):
    """A virtual loop without threads: what goes to one is done at once, while time stands still."""

    def run_in_executor(self, _executor: object, function: Callable[..., Any], *arguments: object) -> Any:
        done = self.create_future()
        try:
            done.set_result(function(*arguments))
        except Exception as error:  # noqa: BLE001  # the waiting caller gets it
            done.set_exception(error)
        return done


def _run_virtually(work: Coroutine[Any, Any, object]) -> None:
    with asyncio.Runner(loop_factory=_LoneLoop) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, _LoneLoop)
        runner.run(work)
        assert not loop.complaints


@pytest.fixture
def virtually(monkeypatch: pytest.MonkeyPatch) -> None:
    """Run the call and its own gripper in virtual time: minutes take none, and nothing is late."""
    monkeypatch.setattr(asyncio, "run", _run_virtually)
    defaults = (lambda: asyncio.get_running_loop().time(),)
    assert SimulatedGripper.__init__.__defaults__ == (time.monotonic,)
    monkeypatch.setattr(SimulatedGripper.__init__, "__defaults__", defaults)


# -- in a process of its own -------------------------------------------------------------------------------


class Beside:
    """A command that runs at the same time as what is called."""

    def __init__(self, *arguments: str) -> None:
        command = [sys.executable, "-m", "robotiq_async", *arguments]
        environment = os.environ | {"PYTHONPATH": str(ROOT)}
        with forking():
            self.process = subprocess.Popen(
                command,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.PIPE,
                stderr=subprocess.PIPE,
                env=environment,
                text=True,
            )

    def read_line(self) -> str:
        """The next line of its standard output, which is empty when it has ended."""
        assert self.process.stdout is not None
        return self.process.stdout.readline().rstrip("\n")

    def read_error(self) -> str:
        """The next line of its standard error."""
        assert self.process.stderr is not None
        return self.process.stderr.readline().rstrip("\n")

    def finish(self, number: signal.Signals | None = None) -> Outcome:
        """Send it a signal, if one is given, and wait until it has ended."""
        if number is not None:
            self.process.send_signal(number)
        out, err = self.process.communicate(timeout=patience(PATIENCE))
        return Outcome(self.process.returncode, out, err)


@pytest.fixture
def beside() -> Iterator[Callable[..., Beside]]:
    """Starts commands; those that still run at the end of the test are killed."""
    started: list[Beside] = []

    def start(*arguments: str) -> Beside:
        started.append(Beside(*arguments))
        return started[-1]

    yield start
    for each in started:
        each.process.kill()
        each.process.communicate()


@dataclass
class Shell:
    """Starts commands; those that still run at the end of the test are killed."""

    processes: list[Process] = field(default_factory=list)

    async def run(self, *arguments: str) -> Outcome:
        """Run a command to its end."""
        return await self.finish(await self.start(*arguments))

    async def start(self, *arguments: str, stdin: int = DEVNULL) -> Process:
        """Start a command."""
        return await self.forked("-m", "robotiq_async", *arguments, stdin=stdin)

    async def forked(self, *arguments: str, stdin: int = DEVNULL) -> Process:
        """Start this interpreter with the command line imported."""
        with forking():
            return await self.python(*arguments, stdin=stdin)

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
        async with asyncio.timeout(patience(PATIENCE)):
            out, err = await process.communicate()
        assert process.returncode is not None
        return Outcome(process.returncode, out.decode(), err.decode())

    async def read_line(self, process: Process) -> str:
        """The next line of its standard output, which is empty when it has ended."""
        assert process.stdout is not None
        async with asyncio.timeout(patience(PATIENCE)):
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
    for process in list(Terminal.running):
        with contextlib.suppress(ProcessLookupError, ChildProcessError):  # a test may still be waiting for it
            os.kill(process, signal.SIGKILL)
            os.waitpid(process, 0)
    Terminal.running.clear()


# -- recordings -------------------------------------------------------------------------------------------


@pytest.fixture
def grasp(recorded: bytes, tmp_path: Path) -> Path:
    """A recording of a grasp with a fault."""
    file = tmp_path / "grasp.mcap"
    file.write_bytes(recorded)
    return file


@pytest.fixture(scope="session")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> bytes:
    """The same for all tests, which have files of their own."""
    file = tmp_path_factory.mktemp("recorded") / "grasp.mcap"
    asyncio.run(_record(file))
    return file.read_bytes()


async def _record(file: Path) -> None:
    gripper = SimulatedGripper(speedup=20)
    gripper.place_object(Finger.ABC, 150)
    async with (
        SimulatorServer(gripper) as server,
        RobotiqHand(server.address) as hand,
        Recorder(hand, file),
    ):
        await hand.close(speed=200)
        gripper.inject_fault(9)
        await hand.wait_for_state(State.FAULT)
        gripper.clear_faults()
        await hand.wait_for_state(State.RUNNING_IDLE)


def draw_nothing(patch: pytest.MonkeyPatch, words: list[set[str]] | None = None) -> None:
    """Let matplotlib write empty pictures: to draw one takes longer than all else that a command does.

    The list gets the words of each picture.
    """
    from matplotlib.figure import Figure  # noqa: PLC0415  # few tests draw
    from matplotlib.text import Text  # noqa: PLC0415

    def draw(figure: Figure, *_: object) -> None:
        if words is not None:
            words.append({text.get_text() for text in figure.findobj(Text)})

    patch.setattr(Figure, "draw", draw)


@pytest.fixture
def undrawn(monkeypatch: pytest.MonkeyPatch) -> None:
    draw_nothing(monkeypatch)


@pytest.fixture
def foreign(tmp_path: Path) -> Callable[..., Path]:
    """Makes a recording that no recorder has written."""

    def write(*messages: bytes, topic: str = "/gripper/event", channel: int = 1) -> Path:
        file = tmp_path / "foreign.mcap"
        with file.open("wb") as stream:
            writer = Writer(stream)
            writer.start()
            writer.register_channel(topic, "json", 0)
            for data in messages:
                writer.add_message(channel, 10**18, data, 10**18)
            writer.finish()  # type: ignore[no-untyped-call]
        return file

    return write
