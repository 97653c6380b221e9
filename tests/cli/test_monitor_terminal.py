"""``robotiq-async monitor`` on a terminal: what quitting, signals and a closed terminal leave behind."""

from __future__ import annotations

import asyncio
import fcntl
import os
import pty
import signal
import struct
import sys
import termios
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager
from typing import ClassVar

import pytest

from robotiq_async import RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import ROOT, WITHOUT


@pytest.fixture(autouse=True)
def nothing_is_left() -> Iterator[None]:
    yield
    for process in Terminal.running:
        os.kill(process, signal.SIGKILL)
        os.waitpid(process, 0)
    Terminal.running.clear()


class Terminal:
    """Python on a terminal of its own (Linux, macOS)."""

    running: ClassVar[set[int]] = set()

    def __init__(self, *arguments: str) -> None:
        self.out = b""
        self._process, self._fd = pty.fork()
        if self._process == 0:
            fcntl.ioctl(0, termios.TIOCSWINSZ, struct.pack("HHHH", 30, 100, 0, 0))
            os.environ |= {"TERM": "xterm-256color", "PYTHONPATH": str(ROOT)}
            os.execv(sys.executable, [sys.executable, *arguments])
        self.running.add(self._process)
        asyncio.get_running_loop().add_reader(self._fd, self._read)
        self._read_something = asyncio.Event()

    def _read(self) -> None:
        try:
            self.out += os.read(self._fd, 65536)
        except OSError:  # the command has ended
            asyncio.get_running_loop().remove_reader(self._fd)
        self._read_something.set()

    async def shows(self, words: bytes) -> None:
        async with asyncio.timeout(30):
            while words not in self.out:
                self._read_something.clear()
                await self._read_something.wait()

    def press(self, keys: str) -> None:
        os.write(self._fd, keys.encode())

    def kill(self, number: signal.Signals) -> None:
        os.kill(self._process, number)

    def stop_reading(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)

    def read_on(self) -> None:
        asyncio.get_running_loop().add_reader(self._fd, self._read)

    def hang_up(self) -> None:
        asyncio.get_running_loop().remove_reader(self._fd)
        os.close(self._fd)

    async def end(self) -> int:
        async with asyncio.timeout(30):
            _, status = await asyncio.to_thread(os.waitpid, self._process, 0)
        self.running.discard(self._process)
        return os.waitstatus_to_exitcode(status)


async def told_to_go(gripper: SimulatedGripper) -> None:
    """Wait for a command of another process."""
    async with asyncio.timeout(20):
        while not gripper.request_registers[0] & 0x0800:  # noqa: ASYNC110
            await asyncio.sleep(0.01)


@asynccontextmanager
async def closing(
    gripper: SimulatedGripper, *options: str
) -> AsyncIterator[tuple[Terminal, SimulatedGripper]]:
    """A monitor that has told an active gripper to close."""
    async with SimulatorServer(gripper) as server:
        async with RobotiqHand(server.address):
            pass
        terminal = Terminal("-m", "robotiq_async", "monitor", *options, server.address)
        await terminal.shows(b"RUNNING_IDLE")
        terminal.press("c")
        await told_to_go(gripper)
        yield terminal, gripper


async def test_quitting_without_having_moved_leaves_the_fingers_alone(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(100)
        before = gripper.request_registers
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        await terminal.shows(b"RUNNING_IDLE")
        terminal.press("q")
        await terminal.shows(b"The fingers were left as they are")
        assert await terminal.end() == 0
        assert gripper.request_registers == before


@pytest.mark.parametrize("number", [signal.SIGTERM, signal.SIGINT])
async def test_a_signal_stops_what_was_moved(number: signal.Signals) -> None:
    async with closing(SimulatedGripper(speedup=4)) as (terminal, gripper):
        terminal.kill(number)
        await terminal.shows(b"The fingers were stopped")
        assert await terminal.end() == 0
        assert b"Traceback" not in terminal.out
        assert not gripper.request_registers[0] & 0x0800


async def test_a_terminal_that_is_closed_stops_what_was_moved() -> None:
    async with closing(SimulatedGripper(speedup=4)) as (terminal, gripper):
        terminal.hang_up()
        assert await terminal.end() == 0
        assert not gripper.request_registers[0] & 0x0800


@pytest.mark.parametrize("first", [signal.SIGTERM, signal.SIGHUP])
@pytest.mark.parametrize("second", [signal.SIGTERM, signal.SIGHUP])
async def test_two_signals_do_not_keep_each_other_from_stopping(
    first: signal.Signals, second: signal.Signals
) -> None:
    """Closing a terminal sends two: one from the system, one from the shell."""
    async with closing(SimulatedGripper(speedup=4)) as (terminal, gripper):
        terminal.kill(first)
        terminal.kill(second)
        await terminal.shows(b"The fingers were stopped")
        assert await terminal.end() == 0
        assert not gripper.request_registers[0] & 0x0800


async def test_a_terminal_that_stops_reading_holds_nothing_up() -> None:
    async with closing(SimulatedGripper(), "--speed", "0") as (terminal, gripper):
        terminal.stop_reading()
        for _ in range(20):  # what fills the terminal, and textual's queue behind it, many times
            terminal.press("+-")
            await asyncio.sleep(0.2)  # the speed of a person's hands
        terminal.press(" ")
        async with asyncio.timeout(5):
            while gripper.request_registers[0] & 0x0800 or gripper.is_moving:  # noqa: ASYNC110
                await asyncio.sleep(0.01)  # by itself the close takes ten seconds
        terminal.kill(signal.SIGTERM)
        terminal.read_on()
        assert await terminal.end() == 0


async def test_keys_of_before_the_screen_are_no_commands(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        terminal.press("ryryry")
        await terminal.shows(b"RUNNING_IDLE")
        for _ in range(100):
            await anext(hand.statuses())
        assert hand.state is State.RUNNING_IDLE
        terminal.press("nqnq")
        assert await terminal.end() == 0


async def test_without_textual_one_line_names_the_extra_and_another_way() -> None:
    terminal = Terminal("-c", WITHOUT.format("textual", ["monitor"]))
    await terminal.shows(b"pip install 'robotiq-async[monitor]', or pass --watch")
    assert await terminal.end() == 1
