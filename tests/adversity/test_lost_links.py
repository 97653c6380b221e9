"""A link that fails at the worst moment: a cancelled move is stopped or fails, and no call waits for long."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.simulator import Trouble
from tests.adversity.world import World, started
from tests.virtual import inside

A = Finger.A


@inside(started)
@pytest.mark.parametrize("trouble", [Trouble("silence"), Trouble("close"), Trouble("drop", on="write")])
async def test_a_cancelled_move_stops_also_when_the_link_fails_at_that_moment(
    here: World, trouble: Trouble
) -> None:
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    await asyncio.sleep(0.3)
    async with here.server.fault_injector.making(trouble):
        moving.cancel()
        await asyncio.sleep(0.3)
    await asyncio.sleep(0.3)
    await here.nothing_moves_for(3)
    assert here.hand.state is State.RUNNING_IDLE
    assert here.gripper.position(A) < 200


@inside(started)
@pytest.mark.parametrize("turns", range(1, 12))
async def test_a_move_cancelled_in_the_turn_in_which_the_link_is_lost_is_stopped_or_told(
    here: World, turns: int
) -> None:
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    await asyncio.sleep(0.3)
    await here.server.fault_injector.begin(Trouble("close"))
    here.loop.after_turns(turns, moving.cancel)
    await asyncio.wait({moving})
    await asyncio.sleep(4)
    if moving.cancelled():
        assert here.gripper.position(A) < 150
    else:
        assert isinstance(moving.exception(), ConnectionLostError)
