"""A simulated gripper behind real Modbus TCP, twenty-five times as fast as life, for a hand."""

from __future__ import annotations

import pytest

from robotiq_async.simulator import SimulatedGripper
from tests.conftest import Clock


@pytest.fixture
async def gripper(clock: Clock) -> SimulatedGripper:
    return SimulatedGripper(clock, speedup=25)
