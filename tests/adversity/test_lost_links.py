"""A link that fails at the worst moment: a cancelled move is stopped or fails, and no call waits for long."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import ConnectionLostError, Finger, State
from robotiq_async.simulator import Trouble
from tests.adversity.world import started
from tests.virtual import virtual

A = Finger.A


@virtual
@pytest.mark.parametrize("trouble", [Trouble("silence"), Trouble("close"), Trouble("drop", on="write")])
async def test_a_cancelled_move_stops_also_when_the_link_fails_at_that_moment(trouble: Trouble) -> None:
    async with started() as here:
        moving = asyncio.create_task(here.hand.move(255, A, speed=0))
        await asyncio.sleep(0.3)
        async with here.server.fault_injector.making(trouble):
            moving.cancel()
            await asyncio.sleep(0.3)
        await asyncio.sleep(0.3)
        await here.nothing_moves_for(3)
        assert here.hand.state is State.RUNNING_IDLE
        assert here.gripper.position(A) < 200


@virtual
@pytest.mark.parametrize("turns", range(1, 12))
async def test_a_move_cancelled_in_the_turn_in_which_the_link_is_lost_is_stopped_or_told(turns: int) -> None:
    async with started() as here:
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


@virtual
@pytest.mark.parametrize("response_timeout", [0.4, 0.5])
async def test_a_write_fails_within_a_second_on_a_slow_link(response_timeout: float) -> None:
    async with (
        started(response_timeout=response_timeout) as here,
        here.server.fault_injector.making(Trouble("delay", response_timeout - 0.01, on="read")),
    ):
        await asyncio.sleep(1.0)
        heard = len(here.server.heard)
        await here.until(lambda: len(here.server.heard) > heard)
        began = here.loop.time()
        async with here.server.fault_injector.making(Trouble("drop", on="write")):
            with pytest.raises(ConnectionLostError):
                await here.hand.set_position(100)
        assert here.loop.time() - began <= 1.0
