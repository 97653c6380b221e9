"""A client of others for the URCap's text port, which drives real grippers on a UR, on the simulated one.

Those that need an environment of their own are in tests/urcap.
"""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import pytest

from robotiq_async import JAW, TWO_FINGER_85, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, UrcapSimulatorServer
from tests.grippers import shows


@pytest.fixture
def gripper() -> SimulatedGripper:
    return SimulatedGripper(speedup=20, spread=False, model=TWO_FINGER_85)


@pytest.fixture
async def server(gripper: SimulatedGripper) -> AsyncIterator[UrcapSimulatorServer]:
    async with UrcapSimulatorServer(gripper) as server:
        yield server


async def test_pyrobotiqur(gripper: SimulatedGripper, server: UrcapSimulatorServer) -> None:
    ur = pytest.importorskip("pyrobotiqur", reason="needs pyrobotiqur (extra dev)")

    def use() -> list[tuple[int, int]]:
        with ur.RobotiqGripper("127.0.0.1", server.port) as driver:
            driver.activate(poll_interval=0.01)
            gripper.place_object(JAW, 120)
            ends = [driver.close(speed=255), driver.open(speed=255), driver.move_percent(20)]
            assert (driver.get_fault(), driver.get_requested_position()) == (0, 51)
            return [(position, int(status)) for position, status in ends]

    # A contact at full speed reads 6 counts further than a slow one, as recorded.
    assert await asyncio.to_thread(use) == [(126, 2), (3, 3), (51, 3)]


async def test_pyrobotiqur_beside_a_hand_is_another_client(server: UrcapSimulatorServer) -> None:
    ur = pytest.importorskip("pyrobotiqur", reason="needs pyrobotiqur (extra dev)")

    def use() -> None:
        with ur.RobotiqGripper("127.0.0.1", server.port) as driver:
            driver.move(80, speed=255)

    async with RobotiqHand(server.address) as hand:
        await hand.open()
        await asyncio.to_thread(use)
        await shows(hand, lambda status: status.requested_position(JAW) == 80)
        assert hand.statistics.foreign_commands >= 1
        await hand.close()
