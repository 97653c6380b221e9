"""The loop is never held up, and a hand survives one that other code holds up; time limits: adversity."""

from __future__ import annotations

import asyncio
import logging
import sys
import time
from asyncio.subprocess import PIPE
from pathlib import Path

import pytest

from robotiq_async import (
    Finger,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer

ROOT = Path(__file__).parents[2]
A = Finger.A


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
