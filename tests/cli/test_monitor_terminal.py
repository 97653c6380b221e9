"""``robotiq-async monitor`` on a terminal: what quitting, signals and a closed terminal leave behind."""

from __future__ import annotations

import asyncio
import signal
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

import pytest

from robotiq_async import RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.cli.conftest import WITHOUT
from tests.cli.terminal import Terminal
from tests.grippers import active_gripper, until


@asynccontextmanager
async def closing(
    gripper: SimulatedGripper, *options: str
) -> AsyncIterator[tuple[Terminal, SimulatedGripper]]:
    """A monitor that has sent an active gripper to close."""
    async with SimulatorServer(gripper) as server:
        terminal = Terminal("-m", "robotiq_async", "monitor", *options, server.address)
        await terminal.shows(b"READY")
        terminal.press("c")
        await until(lambda: bool(gripper.request_registers[0] & 0x0800))
        yield terminal, gripper


async def test_quitting_without_having_moved_leaves_the_fingers_alone(
    server: SimulatorServer, gripper: SimulatedGripper
) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.move(100)
        before = gripper.request_registers
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        await terminal.shows(b"READY")
        terminal.press("q")
        await terminal.shows(b"The fingers were left as they are")
        assert await terminal.end() == 0
        assert gripper.request_registers == before


async def test_a_terminal_that_is_closed_stops_what_was_moved() -> None:
    async with closing(active_gripper()) as (terminal, gripper):
        terminal.hang_up()
        assert await terminal.end() == 0
        assert not gripper.request_registers[0] & 0x0800


@pytest.mark.parametrize(
    ("first", "second"),
    [
        (signal.SIGINT, None),
        (signal.SIGTERM, None),
        (signal.SIGTERM, signal.SIGHUP),
        (signal.SIGHUP, signal.SIGHUP),
    ],
)
async def test_a_signal_stops_what_was_moved_and_a_second_does_not_keep_it_from_that(
    first: signal.Signals, second: signal.Signals | None
) -> None:
    """Closing a terminal sends two: one from the system, one from the shell."""
    async with closing(active_gripper()) as (terminal, gripper):
        terminal.kill(first)
        if second is not None:
            terminal.kill(second)
        await terminal.shows(b"The fingers were stopped")
        assert await terminal.end() == 0
        assert b"Traceback" not in terminal.out
        assert not gripper.request_registers[0] & 0x0800


async def test_a_terminal_that_stops_reading_holds_nothing_up() -> None:
    async with closing(active_gripper(speedup=1), "--speed", "0") as (terminal, gripper):
        terminal.stop_reading()
        for _ in range(20):  # what fills the terminal, and textual's queue behind it, many times
            terminal.press("+-")
            await asyncio.sleep(0.2)  # the speed of a person's hands
        terminal.press(" ")
        # By itself the close takes ten seconds.
        await until(lambda: not (gripper.request_registers[0] & 0x0800 or gripper.is_moving), within=5)
        terminal.kill(signal.SIGTERM)
        terminal.read_on()
        assert await terminal.end() == 0


async def test_keys_of_before_the_screen_are_no_commands(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        terminal = Terminal("-m", "robotiq_async", "monitor", server.address)
        terminal.press("ryryry")
        await terminal.shows(b"READY")
        for _ in range(100):
            await anext(hand.statuses())
        assert hand.state is State.RUNNING_IDLE
        terminal.press("nqnq")
        assert await terminal.end() == 0


async def test_without_textual_one_line_names_the_extra_and_another_way() -> None:
    terminal = Terminal("-c", WITHOUT.format("textual", ["monitor"]))
    await terminal.shows(b"(the extra monitor), or pass --watch")
    assert await terminal.end() == 1
