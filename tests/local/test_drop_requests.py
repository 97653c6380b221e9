"""drop_requests(): what a client that has lost control no longer gets."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, MoveSupersededError, RobotiqHand
from robotiq_async.simulator import SimulatorServer


@pytest.mark.virtual_time
async def test_what_was_not_sent_is_dropped_and_its_callers_hear_why(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    writes = len(server.gripper.writes)
    waiting = [
        asyncio.ensure_future(hand.set_position(200)),
        asyncio.ensure_future(hand.move(200)),
        asyncio.ensure_future(hand.set_speed(9)),
    ]
    await asyncio.sleep(0)
    hand.drop_requests("the operator has changed")
    for each in waiting:
        with pytest.raises(MoveSupersededError, match="the operator has changed"):
            await each
    await asyncio.sleep(0.2)
    assert len(server.gripper.writes) == writes


@pytest.mark.virtual_time
async def test_a_hold_is_kept_and_what_moves_goes_on_until_it(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.set_position(255, Finger.A)
    hand.drop_requests("the operator has changed")
    assert hand.is_moving
    holding = asyncio.ensure_future(hand.hold(Finger.A))
    await asyncio.sleep(0)
    hand.drop_requests("the operator has changed")
    await holding
    await asyncio.sleep(0.5)
    assert server.gripper.position(Finger.A) < 200


async def test_a_hand_that_does_not_run_has_nothing_to_drop_and_another_thread_is_refused(
    hand: RobotiqHand,
) -> None:
    RobotiqHand().drop_requests("nothing")
    with pytest.raises(RuntimeError, match="outside of the event loop"):
        await asyncio.to_thread(hand.drop_requests, "another thread")
