"""The fixtures that need an event loop, for tests that are marked with ``pytest.mark.anyio``."""

from __future__ import annotations

from collections.abc import AsyncIterator
from typing import TYPE_CHECKING

import pytest

if TYPE_CHECKING:
    from robotiq_async import RobotiqHand
    from robotiq_async.simulator import SimulatedGripper, SimulatorServer


@pytest.fixture
async def _robotiq_server_with_anyio(robotiq_gripper: SimulatedGripper) -> AsyncIterator[SimulatorServer]:
    from .contexts import served  # noqa: PLC0415  # only if the fixture is used

    async with served(robotiq_gripper) as server:
        yield server


@pytest.fixture
async def _robotiq_hand_with_anyio(robotiq_server: SimulatorServer) -> AsyncIterator[RobotiqHand]:
    from .contexts import started  # noqa: PLC0415

    async with started(robotiq_server) as hand:
        yield hand
