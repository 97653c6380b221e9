"""A command whose lease has ended is dropped whole: its speed and its force, too."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, RobotiqError
from robotiq_async.simulator.physics.inbox import Write
from robotiq_async.values.request import Request
from tests.fleet.by_hand import move_slowly
from tests.fleet.world import POLL_S, world
from tests.virtual import LATENCY_S, virtual

A = Finger.A
FROZEN_S = 2.1
"""Longer than the window of a lease."""


def has_it(write: Write) -> bool:
    asked = Request.from_registers(write.registers).axes[0]
    return 201 in (asked.speed, asked.force)


@pytest.mark.parametrize("delay", [each * POLL_S / 8 for each in range(10)], ids=lambda s: f"{s * 1000:g}ms")
@pytest.mark.parametrize("name", ["speed", "force", "command"])
@virtual
async def test_an_agent_that_was_frozen_writes_no_part_of_a_late_command(name: str, delay: float) -> None:
    """Frozen between letting it in and writing it, it wrote the speed on waking, 2.14 s late."""
    async with world() as here:
        await move_slowly(here)
        hand = here.holder.hand

        async def ask() -> None:
            if name == "command":
                hand.command(A, speed=201, force=201)
            else:
                await getattr(hand, f"set_{name}")(201, A)

        asking = asyncio.create_task(here.holder.do(ask()))
        await asyncio.sleep(delay)
        here.agent.host.freeze()
        frozen_at = here.now()
        await asyncio.sleep(FROZEN_S)
        here.agent.host.thaw()
        await asyncio.sleep(1.0)
        first = [write.time for write in here.gripper.writes if has_it(write)][:1]
        assert all(at < frozen_at + 2 * LATENCY_S for at in first), "it was written late"
        await asyncio.wait({asking})
        assert asking.exception() is None or isinstance(asking.exception(), RobotiqError)
