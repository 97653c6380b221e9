"""A hand on another host, when nothing goes wrong."""

from __future__ import annotations

import asyncio

from robotiq_async import Finger, State
from tests.fleet.lab import lab
from tests.virtual import virtual


@virtual
async def test_a_move() -> None:
    async with lab() as here, here.client() as hand:
        assert hand.state is State.RUNNING_IDLE
        result = await hand.move(100, Finger.A)
        assert abs(result.positions[Finger.A] - 100) <= 2
        assert hand.status.position(Finger.A) == result.positions[Finger.A]
        assert not hand.is_moving


@virtual
async def test_a_cancelled_move_is_held() -> None:
    async with lab() as here, here.client() as hand:
        moving = asyncio.create_task(hand.move(200, Finger.A, speed=0))
        while not here.gripper.is_moving:  # noqa: ASYNC110  # what is waited for tells nobody
            await asyncio.sleep(0.001)
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await asyncio.sleep(0.1)
        assert not here.gripper.is_moving
        assert here.gripper.position(Finger.A) < 50


@virtual
async def test_a_move_comes_after_the_commands_before_it() -> None:
    """It was superseded by a command that had waited for its turn."""
    async with lab() as here, here.client() as hand:
        for position in range(60, 100):
            hand.command(Finger.A, position=position)
        result = await hand.move(20, Finger.A)
        assert abs(result.positions[Finger.A] - 20) <= 2


@virtual
async def test_a_hand_that_was_stopped_leaves_the_lease_to_others() -> None:
    """While it waited for the agent to acknowledge the end, it acquired the lease again."""
    async with lab() as here:
        here.network.stream("agent", "client").delay = 0.3
        async with here.client():
            pass
        await asyncio.sleep(0.2)
        async with here.client("other") as hand:
            assert hand.is_in_control
