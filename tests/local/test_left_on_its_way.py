"""Requests that do not act yet when a hand ends: the next hand of the gripper in this process knows them."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, RobotiqHand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer

pytestmark = pytest.mark.virtual_time

A, B = Finger.A, Finger.B


@pytest.mark.parametrize("is_same", [True, False], ids=["the same hand", "another hand"])
@pytest.mark.parametrize("device_cycle", [0.05, 0.2])
async def test_a_held_axis_does_not_resume_after_a_command_to_another(
    device_cycle: float, is_same: bool
) -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, device_cycle=device_cycle)
    async with SimulatorServer(port=0, gripper=gripper) as server:
        first = RobotiqHand(server.address)
        await first.start()
        first.command(A, position=255, speed=0)
        await asyncio.sleep(2.0)
        await first.hold(A)
        await first.stop(halt=False)
        second = first if is_same else RobotiqHand(server.address)
        await second.start(activate=False)
        await second.set_position(100, B)
        await asyncio.sleep(2 * device_cycle)
        at = gripper.position(A)
        await asyncio.sleep(5.0)
        assert gripper.position(A) == at
        assert gripper.position(B) == pytest.approx(100, abs=4)
        await second.stop()


async def test_a_stop_ends_a_motion_that_another_hand_left_before_it_acted() -> None:
    gripper = SimulatedGripper(asyncio.get_running_loop().time, device_cycle=0.2)
    async with SimulatorServer(port=0, gripper=gripper) as server:
        async with RobotiqHand(server.address) as first:
            await first.set_position(255, A)
            await first.stop(halt=False)
        second = RobotiqHand(server.address)
        await second.start(activate=False)
        assert second.is_moving
        await second.stop()
        before = gripper.travel(A)
        await asyncio.sleep(10.0)
        assert gripper.travel(A) == before
