"""Every call ends in its time, and the loop is never held up."""

from __future__ import annotations

import asyncio
import logging
import sys
import time
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest

from robotiq_async import (
    ActivationTimeoutError,
    ConnectFailedError,
    ConnectionLostError,
    Finger,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer, parse_troubles
from robotiq_async.values.request import Request
from tests.grippers import until_moving

ROOT = Path(__file__).parents[2]
A = Finger.A


async def test_a_write_fails_within_a_second_on_a_silent_gripper(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.policy = lambda _: []
    began = time.monotonic()
    with pytest.raises(ConnectionLostError):
        await hand.set_position(200)
    assert time.monotonic() - began < 1.0


async def test_start_on_a_silent_gripper_ends_within_five_seconds(server: SimulatorServer) -> None:
    server.policy = lambda _: []
    began = time.monotonic()
    with pytest.raises(ConnectFailedError):
        await RobotiqHand(server.address).start()
    assert time.monotonic() - began < 5.0


@pytest.mark.virtual_time
async def test_an_activation_that_takes_too_long_fails_the_start_and_is_taken_back() -> None:
    async with SimulatorServer() as server:
        hand = RobotiqHand(server.address, activation_timeout=0.2)
        with pytest.raises(ActivationTimeoutError):
            await hand.start()
        assert not server.gripper.is_moving
        assert not Request.from_registers(server.gripper.request_registers).activate


@pytest.mark.parametrize("what", ["drop on write once", "silence once", "exception on write once", "reset"])
async def test_a_stop_that_was_not_heard_is_sent_again(
    hand: RobotiqHand, server: SimulatorServer, what: str
) -> None:
    await hand.set_position(255)
    await until_moving(server, hand)
    (trouble,) = parse_troubles(what)
    await server.fault_injector.begin(trouble)
    await hand.stop()
    assert not server.gripper.is_moving
    assert not Request.from_registers(server.gripper.request_registers).go


@pytest.mark.parametrize("what", ["silence", "refuse"])
async def test_stop_ends_within_two_seconds_on_a_dead_link(
    hand: RobotiqHand, server: SimulatorServer, what: str
) -> None:
    if what == "silence":
        server.policy = lambda _: []
    else:
        server.refuse()
        server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
    began = time.monotonic()
    await hand.stop()
    assert time.monotonic() - began < 2.0
    assert hand.state is State.SHUTDOWN


async def test_the_first_start_imports_nothing(server: SimulatorServer) -> None:
    # An import holds up the loop: anyio's backend, loaded at first use, did so for 20 ms.
    program = f"""
import asyncio, sys
from robotiq_async import RobotiqHand

async def main():
    before = set(sys.modules)
    async with RobotiqHand({server.address!r}) as hand:
        await hand.move(30)
    print(*(set(sys.modules) - before))

asyncio.run(main())
"""
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", program, stdout=PIPE, cwd=ROOT)
    out, _ = await process.communicate()
    assert (process.returncode, out.decode().split()) == (0, [])


async def test_a_held_up_loop_is_noticed_and_survived(
    hand: RobotiqHand, caplog: pytest.LogCaptureFixture
) -> None:
    moving = asyncio.create_task(hand.move(200, A, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    overruns = hand.statistics.overruns
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        for _ in range(2):
            time.sleep(0.6)  # noqa: ASYNC251  # longer than the response timeout
            await asyncio.sleep(0.02)
    await moving
    statistics = hand.statistics
    assert statistics.reconnects == 0
    assert statistics.overruns - overruns >= 100
    assert statistics.longest_stall > 0.5
    assert len([record for record in caplog.records if "holds up" in record.message]) <= 2
