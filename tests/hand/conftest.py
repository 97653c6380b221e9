"""A simulated gripper behind real Modbus TCP, twenty-five times as fast as life, for a hand."""

from __future__ import annotations

import pytest

from robotiq_async.simulator import SimulatedGripper
from tests.conftest import Clock
from tests.contract.test_loops import CALLS

REQUESTS = {
    name: call
    for name, call in CALLS.items()
    if name not in ("wait_for_state", "stop", "statuses", "transitions", "requests", "grip_events")
}
"""Every call that asks something of the gripper."""


@pytest.fixture
async def gripper(clock: Clock) -> SimulatedGripper:
    return SimulatedGripper(clock, speedup=25)
