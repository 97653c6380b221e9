"""A simulated gripper behind real Modbus TCP, twenty-five times as fast as life, and a hand on it."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest_asyncio

from robotiq_async import RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer


class Clock:
    """Real time that can be moved ahead."""

    def __init__(self) -> None:
        self.ahead = 0.0

    def __call__(self) -> float:
        return asyncio.get_running_loop().time() + self.ahead


@pytest_asyncio.fixture
async def clock() -> Clock:
    return Clock()


@pytest_asyncio.fixture
async def server(clock: Clock) -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(SimulatedGripper(clock, speedup=25)) as server:
        yield server


@pytest_asyncio.fixture
async def hand(server: SimulatorServer, clock: Clock) -> AsyncIterator[RobotiqHand]:
    """A hand that has activated its gripper; the seconds of the activation are skipped."""
    hand = RobotiqHand(server.address)
    transitions = hand.transitions()
    starting = asyncio.create_task(hand.start())
    while (await anext(transitions)).target is not State.WF_ACTIVATION:
        pass
    clock.ahead += 10
    await starting
    yield hand
    await hand.stop()
