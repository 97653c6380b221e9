"""Following a hand: its streams, and waiting for a state."""

from __future__ import annotations

import asyncio
import contextlib
import itertools

import pytest

from robotiq_async import (
    NotStartedError,
    RobotiqHand,
    State,
    StateTimeoutError,
    Transition,
)
from robotiq_async.simulator import SimulatorServer

pytestmark = pytest.mark.virtual_time


async def test_wait_for_state(hand: RobotiqHand) -> None:
    assert await hand.wait_for_state(State.FAULT, State.RUNNING_IDLE) is State.RUNNING_IDLE
    with pytest.raises(StateTimeoutError):
        await hand.wait_for_state(State.FAULT, timeout=0.02)
    waiting = asyncio.create_task(hand.wait_for_state(State.RUNNING_CC))
    await asyncio.sleep(0)
    hand.command(position=5)
    assert await waiting is State.RUNNING_CC


async def test_waiting_for_a_state_ends_with_stop(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
        shutdown = asyncio.create_task(hand.wait_for_state(State.SHUTDOWN))
        await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        await waiting
    assert await shutdown is State.SHUTDOWN
    with pytest.raises(NotStartedError):
        await hand.wait_for_state(State.RUNNING_IDLE)


async def test_transitions_opened_before_start_lose_nothing_and_end_after_stop(
    server: SimulatorServer,
) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.transitions()

    async def collect() -> list[Transition]:
        return [transition async for transition in stream]

    collecting = asyncio.create_task(collect())
    async with hand:
        for _ in range(20):
            await hand.set_position(20)
    seen = await collecting
    assert seen[0].source is State.DISCONNECTED
    assert seen[-1].target is State.SHUTDOWN
    assert all(before.target is after.source for before, after in itertools.pairwise(seen))
    assert [each.target for each in seen].count(State.RUNNING_CC) == 20
    stamps = [each.timestamp for each in seen]
    assert stamps == sorted(stamps)


async def test_statuses_opened_before_start_wait_and_end_after_stop(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.statuses(buffer=100_000)

    async def collect() -> list[int]:
        return [status.sequence async for status in stream]

    collecting = asyncio.create_task(collect())
    await asyncio.sleep(0)
    async with hand:
        await hand.move(50)
    sequence = await collecting
    assert sequence == list(range(len(sequence)))
    assert stream.missed == 0


async def test_statuses_with_aclosing(hand: RobotiqHand) -> None:
    async with contextlib.aclosing(hand.statuses()) as statuses:
        async for status in statuses:
            assert status is hand.status
            break
    with pytest.raises(StopAsyncIteration):
        await anext(statuses)
