"""Faults and releases, and the way out of them."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    Fault,
    Finger,
    GripperFaultError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer
from tests.hand.watching import settled, until_moving

pytestmark = pytest.mark.virtual_time

A = Finger.A


@pytest.mark.parametrize("fault", [Fault.SCISSOR_BLOCKED, Fault.ACTIVATION_FAULT, 0x0C])
async def test_recover_from_a_major_fault(hand: RobotiqHand, server: SimulatorServer, fault: int) -> None:
    server.gripper.inject_fault(fault)
    await hand.wait_for_state(State.FAULT)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    await hand.move(100, A)


async def test_recover_from_a_minor_fault_waits_and_keeps_the_activation(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2.0)
    await hand.wait_for_state(State.FAULT)
    writes = len(server.gripper.writes)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    assert len(server.gripper.writes) == writes


async def test_recover_from_a_release(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.emergency_release()
    await hand.wait_for_state(State.FAULT)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE


async def test_activation_fault_of_its_own_fails_the_start(server: SimulatorServer) -> None:
    server.gripper.fail_activation = True
    hand = RobotiqHand(server.address)
    with pytest.raises(GripperFaultError) as caught:
        await hand.start()
    assert caught.value.fault is Fault.ACTIVATION_FAULT
    assert hand.state is State.SHUTDOWN
    await hand.start()
    assert hand.state is State.FAULT, "a fault that is there already is not start()'s business"
    await hand.recover()
    await hand.stop()


async def test_start_on_a_released_gripper_returns_in_atr_done(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        server.gripper.emergency_release()
        await hand.wait_for_state(State.ATR_DONE, timeout=20)
    async with RobotiqHand(server.address) as hand:
        assert hand.state is State.ATR_DONE
        await hand.recover()


async def test_a_fault_ends_a_move_and_nothing_resumes(hand: RobotiqHand, server: SimulatorServer) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await until_moving(server, hand)
    server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    with pytest.raises(GripperFaultError) as caught:
        await moving
    assert caught.value.fault is Fault.COMMUNICATION_NOT_READY
    await hand.wait_for_state(State.RUNNING_IDLE)
    at = server.gripper.position(A)
    await settled(hand)
    assert server.gripper.position(A) == pytest.approx(at, abs=2)
