"""A hand without its link; what else a lost link does to it: tests/adversity/test_matrix.py."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    ConnectionLostError,
    Finger,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer

A = Finger.A


async def test_nothing_can_be_asked_for_while_it_connects(server: SimulatorServer) -> None:
    server.policy = lambda frame: [(0.1, frame)]
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start(activate=False))
    await asyncio.sleep(0)
    for call in (hand.activate, hand.reset, hand.atr, hand.hold, hand.halt):
        with pytest.raises(ConnectionLostError):
            await call()
    await starting
    assert hand.state is State.RESET
    await hand.stop()


async def test_a_hand_that_must_not_reconnect_gives_up(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address, reconnect=False)
    await hand.start()
    statuses = hand.statuses()
    waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
    await anext(statuses)
    server.cut()

    async def read_on() -> None:
        async for _ in statuses:
            pass

    with pytest.raises(ConnectionLostError):
        await read_on()
    with pytest.raises((ConnectionLostError, NotStartedError)):
        await waiting
    with pytest.raises(ConnectionLostError):
        await hand.move(3)
    with pytest.raises(ConnectionLostError):
        await anext(hand.statuses())
    await hand.stop()
    await hand.start()
    await hand.move(30, A)
    await hand.stop()
