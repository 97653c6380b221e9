"""The hand on a serial line: pseudo-terminals and the simulator's RTU server."""

from __future__ import annotations

import asyncio
import time
from collections.abc import AsyncIterator
from pathlib import Path

import pytest
import pytest_asyncio

from robotiq_async import ConnectionLostError, Fault, Finger, RobotiqHand, State
from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper
from tests.conftest import Clock
from tests.grippers import until_moving
from tests.patience import patience
from tests.serial_line import SerialLine

A = Finger.A
TIMEOUT_S = 0.4
LONGEST_TIMEOUT_S = 2.0


@pytest.fixture
def timeout() -> float:
    """The longer, the busier the machine: the two ends of the line wait for a core in turns."""
    return min(patience(TIMEOUT_S), LONGEST_TIMEOUT_S)


@pytest_asyncio.fixture
async def line(tmp_path: Path) -> AsyncIterator[SerialLine]:
    with SerialLine(tmp_path) as line:
        yield line


@pytest_asyncio.fixture
async def serial_server(line: SerialLine, clock: Clock) -> AsyncIterator[SerialSimulatorServer]:
    async with SerialSimulatorServer(line.far, SimulatedGripper(clock, speedup=25)) as server:
        yield server


@pytest_asyncio.fixture
async def serial_hand(
    line: SerialLine, serial_server: SerialSimulatorServer, timeout: float
) -> AsyncIterator[RobotiqHand]:
    # A few polls are in the shortest time for which replies are held back; more reveal no more.
    async with RobotiqHand(f"rtu://{line.near}", response_timeout=timeout, poll_interval=0.02) as hand:
        yield hand


async def test_a_move_over_a_serial_line(
    serial_hand: RobotiqHand, serial_server: SerialSimulatorServer
) -> None:
    serial_server.gripper.place_object(Finger.B, 100)
    result = await serial_hand.move(200, speed=255)
    assert result.contacts == Finger.B
    assert result.positions[A] == pytest.approx(200, abs=2)
    assert serial_hand.statistics.reconnects == 0


async def test_a_pulled_line_comes_back(
    serial_hand: RobotiqHand, serial_server: SerialSimulatorServer, line: SerialLine
) -> None:
    moving = asyncio.create_task(serial_hand.move(255, speed=0))
    await serial_hand.wait_for_state(State.RUNNING_CC)
    await until_moving(serial_server, serial_hand)
    writes = len(serial_server.gripper.writes)
    line.pull()
    with pytest.raises(ConnectionLostError, match="the port is gone, or another program reads from it"):
        await moving
    line.plug()
    await serial_hand.wait_for_state(State.RUNNING_IDLE, timeout=patience(5))
    assert len(serial_server.gripper.writes) == writes
    await serial_hand.move(20, A)


@pytest.mark.parametrize("share", [0.125, 1.25, 2.25])
async def test_replies_held_back_never_become_a_status(
    serial_hand: RobotiqHand,
    serial_server: SerialSimulatorServer,
    line: SerialLine,
    timeout: float,
    share: float,
) -> None:
    """For a share of the timeout."""
    line.held = []
    await asyncio.get_running_loop().run_in_executor(None, time.sleep, share * timeout)
    serial_server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    changed_at = asyncio.get_running_loop().time()
    statuses = serial_hand.statuses(buffer=1000)
    line.let_go()  # the reply held back has no fault
    async for status in statuses:
        # A reply within the timeout may be as old as that; then it was requested at that time, too.
        age = status.timestamp - changed_at
        assert status.fault or age < timeout, f"{age:.3f} s old: {status!r}"
        if age > 1.25 * timeout:
            break
