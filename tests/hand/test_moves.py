"""Moves, commands, the halt and the hold, as the gripper gets them."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    CLOSED,
    OPEN,
    Finger,
    MoveSupersededError,
    MoveTimeoutError,
    ObjectStatus,
    RobotiqHand,
    RobotiqStatus,
    State,
)
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from tests.hand.watching import last_write

pytestmark = pytest.mark.virtual_time

A, B, C, S = THREE_FINGER.axes


async def test_set_speed_and_force(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_speed(7, A | S)
    await hand.set_force(9, B)
    image = last_write(server)
    assert [axis.speed for axis in image.axes] == [7, 128, 128, 7]
    assert [axis.force for axis in image.axes] == [64, 9, 64, 64]
    assert not image.go


async def test_integer_masks_are_as_good_as_fingers(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_speed(5, 10)
    assert [axis.speed for axis in last_write(server).axes] == [128, 5, 128, 5]
    result = await hand.move(50, 1)
    assert set(result.outcomes) == {A}


async def test_command_merges_until_the_next_poll(hand: RobotiqHand, server: SimulatorServer) -> None:
    writes = len(server.gripper.writes)
    for value in range(50):
        hand.command(position=value)
    hand.command(A, speed=255)
    assert hand.is_moving
    assert hand.state is State.RUNNING_CC
    await hand.wait_for_state(State.RUNNING_IDLE)
    assert len(server.gripper.writes) == writes + 1
    assert last_write(server).position(A) == 49


async def test_move_open_and_close(hand: RobotiqHand) -> None:
    closed = await hand.close(speed=255)
    assert closed.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert all(position >= 240 for position in closed.positions.values())
    opened = await hand.open(A, speed=255)
    assert opened.positions[A] <= 7
    assert (OPEN, CLOSED) == (0, 255)


async def test_move_with_an_object(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.place_object(Finger.ABC, position=150)
    result = await hand.move(255)
    assert result.object_detected
    assert result.contacts == Finger.ABC
    assert result.status.contacts == Finger.ABC
    assert hand.status.position(A) == pytest.approx(150, abs=3)


async def test_move_times_out_and_holds(hand: RobotiqHand, server: SimulatorServer) -> None:
    with pytest.raises(MoveTimeoutError) as caught:
        await hand.move(255, speed=0, timeout=0.2)
    assert isinstance(caught.value, TimeoutError)
    assert isinstance(caught.value.status, RobotiqStatus)
    async for _ in hand.statuses():
        if not hand.is_moving:
            break
    assert not server.gripper.is_moving
    assert hand.status.position(A) < 200


async def test_halt(hand: RobotiqHand, server: SimulatorServer) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    await hand.halt()
    assert not hand.is_moving
    assert not server.gripper.is_moving
    with pytest.raises(MoveSupersededError):
        await moving
    await hand.move(30, A)


async def test_hold(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.place_object(B, position=20)
    moves = [asyncio.create_task(hand.move(255, axis, speed=0)) for axis in (A, B, C)]
    assert (await moves[1]).contacts == B
    await hand.hold(A | B)
    with pytest.raises(MoveSupersededError, match="hold"):
        await moves[0]
    assert last_write(server).position(A) < 255
    assert [last_write(server).position(axis) for axis in (B, C)] == [255, 255], "a grip, and a motion"
    await hand.hold()
    with pytest.raises(MoveSupersededError):
        await moves[2]
    assert last_write(server).position(B) == 255
    async for _ in hand.statuses():
        if not hand.is_moving:
            break
    writes = len(server.gripper.writes)
    await hand.hold()
    assert len(server.gripper.writes) == writes, "nothing moves"
    await hand.reset()
    await hand.hold()
    assert hand.state is State.RESET
