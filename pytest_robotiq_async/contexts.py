"""Contexts for a server and a hand: they live as long as their test."""

from __future__ import annotations

from collections.abc import AsyncIterator
from contextlib import asynccontextmanager

from robotiq_async import RobotiqHand
from robotiq_async.runtime import running_loop
from robotiq_async.simulator import SimulatedGripper, SimulatorServer


@asynccontextmanager
async def served(gripper: SimulatedGripper) -> AsyncIterator[SimulatorServer]:
    """A gripper behind Modbus TCP."""
    running_loop()  # raises with the remedy in another framework's loop
    async with SimulatorServer(gripper) as server:
        yield server


@asynccontextmanager
async def started(server: SimulatorServer) -> AsyncIterator[RobotiqHand]:
    """A hand at it, active."""
    async with RobotiqHand(server.address) as hand:
        yield hand
