"""The outcomes of a move."""

from __future__ import annotations

import asyncio

import anyio
import pytest

from robotiq_async import (
    CLOSED,
    OPEN,
    Finger,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    ObjectStatus,
    RobotiqStatus,
)
from robotiq_async.hands import Hand
from robotiq_async.values.request import AxisRequest, Request
from tests.contract.bench import A, B, Bench, C, at_rest, contract, ended


@contract
async def test_there(here: Bench, hand: Hand) -> None:
    closed = await hand.close(speed=255, force=10)
    assert closed.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert not closed.object_detected
    assert all(position >= 240 for position in closed.positions.values())
    assert hand.status.sequence >= closed.status.sequence
    assert hand.status.position(A) == closed.positions[A]
    assert not hand.is_moving
    assert [axis.force for axis in here.last_write.axes[:3]] == [10] * 3
    opened = await hand.open(A, speed=255)
    assert set(opened.positions) == {A}
    assert opened.positions[A] <= 7
    assert 0 < opened.duration < 5
    assert set(opened.peak_current_ma) == {A}
    assert (OPEN, CLOSED) == (0, 255)


@contract
async def test_against_something(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    result = await hand.move(255)
    assert result.object_detected
    assert result.contacts == Finger.ABC
    assert result.outcomes[B] is ObjectStatus.CONTACT_CLOSING
    assert result.positions[A] == pytest.approx(150, abs=3)
    assert result.peak_current_ma[A]
    assert result.status.contacts == Finger.ABC


@contract
async def test_against_something_on_the_way_open(here: Bench, hand: Hand) -> None:
    await hand.move(200, speed=255)
    here.gripper.place_object(A, 100, opening=True)
    result = await hand.open(Finger.ABC, speed=255)
    assert result.contacts == A
    assert result.outcomes[A] is ObjectStatus.CONTACT_OPENING
    assert result.outcomes[B] is ObjectStatus.AT_POSITION


@contract
async def test_too_slow(here: Bench, hand: Hand) -> None:
    began = asyncio.get_running_loop().time()
    with pytest.raises(MoveTimeoutError) as caught:
        await hand.move(255, speed=0, timeout=0.3)
    assert asyncio.get_running_loop().time() - began < 0.5
    assert isinstance(caught.value, TimeoutError)
    status = caught.value.status
    assert isinstance(status, RobotiqStatus)
    assert status.is_moving
    assert 0 <= hand.status.timestamp - status.timestamp < 0.1
    assert 0 <= hand.status.sequence - status.sequence < 20
    await at_rest(hand)
    assert here.gripper.position(A) < 200


@contract
async def test_halted(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    await hand.halt()
    assert isinstance(await ended(moving), MoveSupersededError)
    await hand.move(30, A)


@contract
async def test_superseded_by_another_move(here: Bench, hand: Hand) -> None:
    first = await here.moving(hand.move(255, speed=0))
    second = await hand.move(40, A | B, speed=255)
    assert isinstance(await ended(first), MoveSupersededError)
    assert second.positions[A] == pytest.approx(40, abs=2)
    await hand.halt()


@contract
async def test_superseded_by_another_client_of_the_gripper(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    image = Request(activate=True, go=True, axes=(AxisRequest(10, 255, 100),) * 4)
    here.gripper.write(0, image.registers)
    assert isinstance(await ended(moving), MoveSupersededError)


@contract
async def test_moves_of_different_axes_do_not_disturb_each_other(here: Bench, hand: Hand) -> None:
    one, other = await asyncio.gather(hand.move(60, A), hand.move(120, B | C, speed=255))
    assert one.positions[A] == pytest.approx(60, abs=2)
    assert other.positions[C] == pytest.approx(120, abs=2)


@contract
async def test_reset(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    await hand.reset()
    assert isinstance(await ended(moving), MoveSupersededError)
    with pytest.raises(NotActivatedError):
        await hand.move(3)


@contract
async def test_stopped(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    await hand.stop()
    assert isinstance(await ended(moving), NotStartedError)


@contract
@pytest.mark.parametrize("how", ["task", "asyncio", "anyio"])
async def test_cancelled(here: Bench, hand: Hand, how: str) -> None:
    if how == "task":
        moving = await here.moving(hand.move(255, speed=0))
        moving.cancel()
        assert isinstance(await ended(moving), asyncio.CancelledError)
    elif how == "asyncio":
        with pytest.raises(TimeoutError):
            async with asyncio.timeout(0.1):
                await hand.move(255, speed=0)
    else:
        with anyio.move_on_after(0.1) as scope:
            await hand.move(255, speed=0)
        assert scope.cancelled_caught
    await at_rest(hand)
    assert here.gripper.position(A) < 100
    await hand.move(150, A, speed=255)


@contract
@pytest.mark.parametrize("milliseconds", [30, 8, 4.6, 2.6, 1, 0])
async def test_cancelled_at_any_moment(here: Bench, hand: Hand, milliseconds: float) -> None:
    """In motion; acknowledged; written, by a remote hand too; not yet written."""
    moving = asyncio.create_task(hand.move(255, speed=0))
    await asyncio.sleep(milliseconds / 1000)
    moving.cancel()
    assert isinstance(await ended(moving), asyncio.CancelledError)
    await asyncio.sleep(0.1)
    assert not here.gripper.is_moving
    await at_rest(hand)
    assert here.gripper.position(A) < 100


@contract
async def test_cancelled_with_a_part_in_the_grip(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=30)
    moving = asyncio.create_task(hand.move(255, Finger.ABC, speed=0))
    async for status in hand.statuses():
        if status.contacts:
            break
    moving.cancel()
    await ended(moving)
    await at_rest(hand)
    assert here.last_write.position(A) == 255, "the grip stays"
    assert here.gripper.position(B) < 100
