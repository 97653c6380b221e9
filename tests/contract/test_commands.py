"""Positions, speeds and forces; the halt and the hold."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, MoveSupersededError, NotActivatedError, State
from robotiq_async.hands import Hand
from tests.contract.bench import A, B, Bench, C, S, at_rest, contract, ended


@contract
async def test_set_position_returns_when_acknowledged(here: Bench, hand: Hand) -> None:
    await hand.set_position(200, A)
    assert here.last_write.position(A) == 200
    assert here.gripper.position(A) < 100
    assert hand.is_moving


@contract
async def test_speed_and_force_start_no_motion(here: Bench, hand: Hand) -> None:
    travels = here.travels
    await hand.set_speed(7, A | S)
    await hand.set_force(9, B)
    assert [axis.speed for axis in here.last_write.axes] == [7, 128, 128, 7]
    assert [axis.force for axis in here.last_write.axes] == [64, 9, 64, 64]
    await asyncio.sleep(0.5)
    assert here.travels == travels


@contract
async def test_a_command_moves_only_what_it_addresses(here: Bench, hand: Hand) -> None:
    before = here.travels
    await hand.set_position(100, B)
    await at_rest(hand)
    assert [after > was for after, was in zip(here.travels, before, strict=True)] == [
        False,
        True,
        False,
        False,
    ]


@contract
async def test_a_command_moves_from_the_moment_it_is_asked_for(here: Bench, hand: Hand) -> None:
    hand.command(position=100)
    moves = []
    async for _ in hand.statuses():
        moves.append(hand.is_moving)
        if not moves[-1]:
            break
    assert len(moves) > 20, "it does not seem to stand in between"
    assert here.gripper.position(A) == pytest.approx(100, abs=2)


@contract
async def test_is_moving_right_after_a_command(here: Bench, hand: Hand) -> None:
    hand.command(speed=3)
    assert not hand.is_moving
    hand.command(position=100)
    assert hand.is_moving


@contract
async def test_the_last_value_wins(here: Bench, hand: Hand) -> None:
    writes = here.writes
    for value in range(200):
        hand.command(position=value)
    hand.command(A, speed=255)
    hand.command(C, force=11)
    await at_rest(hand)
    assert here.last_write.position(A) == 199
    assert [axis.speed for axis in here.last_write.axes] == [255, 128, 128, 128]
    assert here.last_write.axes[2].force == 11
    assert here.writes <= writes + 5, "nothing queues"


@contract
async def test_a_loop_that_commands_at_every_status(here: Bench, hand: Hand) -> None:
    value = 0
    async for _ in hand.statuses():
        value += 1
        hand.command(position=value)
        if value == 40:
            break
    await at_rest(hand)
    assert here.last_write.position(A) == 40


@contract
@pytest.mark.parametrize("waits", [0, 1, 30])
async def test_the_last_command_wins_over_all_calls(here: Bench, hand: Hand, waits: int) -> None:
    for value in range(waits):
        hand.command(position=value)
    hand.command(position=90)
    await hand.set_position(30)
    await at_rest(hand)
    assert here.last_write.position(A) == 30
    assert here.gripper.position(A) == pytest.approx(30, abs=2)


@contract
async def test_awaited_commands_keep_their_order(here: Bench, hand: Hand) -> None:
    await asyncio.gather(*(hand.set_position(value) for value in (200, 100, 40)))
    await at_rest(hand)
    assert here.gripper.position(A) == pytest.approx(40, abs=2)


@contract
async def test_a_halt_stops_every_axis(here: Bench, hand: Hand) -> None:
    await hand.set_position(255, Finger.ALL)
    await here.moves()
    await hand.halt()
    assert not hand.is_moving
    assert not here.gripper.is_moving
    assert not here.last_write.go
    await hand.move(20, A)


@contract
@pytest.mark.parametrize("count", [1, 3, 50])
async def test_nothing_commanded_before_a_halt_comes_after_it(here: Bench, hand: Hand, count: int) -> None:
    for value in range(count):
        hand.command(position=255 - value)
    await hand.halt()
    assert not hand.is_moving
    await asyncio.sleep(0.2)
    travels = here.travels
    await asyncio.sleep(0.5)
    assert here.travels == travels
    assert not here.last_write.go


@contract
@pytest.mark.parametrize("milliseconds", [12, 10.4, 8, 1, 0])
async def test_a_cancelled_halt_is_still_sent(here: Bench, hand: Hand, milliseconds: float) -> None:
    """Written a second time; at rest; written; not yet written."""
    await hand.set_position(255, Finger.ALL)
    await here.moves()
    halting = asyncio.create_task(hand.halt())
    await asyncio.sleep(milliseconds / 1000)
    halting.cancel()
    assert isinstance(await ended(halting), asyncio.CancelledError)
    await at_rest(hand)
    assert here.gripper.position(A) < 200


@contract(active=False)
async def test_a_halt_during_an_activation_ends_in_reset(here: Bench, hand: Hand) -> None:
    activating = await here.moving(hand.activate())
    await hand.halt()
    assert hand.state is State.RESET
    assert not here.gripper.is_moving
    assert isinstance(await ended(activating), NotActivatedError)
    await hand.halt()


@contract
async def test_a_hold_keeps_axes_where_they_are(here: Bench, hand: Hand) -> None:
    await hand.set_speed(50)
    await hand.set_position(200, Finger.ABC)
    await here.moves()
    await asyncio.sleep(0.2)
    await hand.hold(A | B)
    at = here.gripper.position(A)
    await at_rest(hand)
    assert here.gripper.position(A) == pytest.approx(at, abs=6)
    assert here.gripper.position(A) < 150
    assert here.gripper.position(C) == pytest.approx(200, abs=2)


@contract
async def test_a_hold_leaves_a_grip_alone(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=100)
    await hand.move(255)
    await hand.hold()
    await asyncio.sleep(0.1)
    assert here.last_write.position(A) == 255
    assert hand.status.contacts == Finger.ABC


@contract
@pytest.mark.parametrize("milliseconds", [4.6, 2.6, 1, 0])
async def test_a_cancelled_command_is_carried_out_or_not_and_the_next_one_works(
    here: Bench, hand: Hand, milliseconds: float
) -> None:
    """Written, by a hand of this process, and by one on another host; not yet written."""
    setting = asyncio.create_task(hand.set_position(200))
    await asyncio.sleep(milliseconds / 1000)
    setting.cancel()
    await ended(setting)
    await hand.set_position(30)
    await at_rest(hand)
    assert here.gripper.position(A) == pytest.approx(30, abs=2)


@contract(active=False)
async def test_while_reset_nothing_moves(here: Bench, hand: Hand) -> None:
    for call in (lambda: hand.move(100), lambda: hand.set_position(3), lambda: hand.set_speed(3)):
        with pytest.raises(NotActivatedError):
            await call()
    with pytest.raises(NotActivatedError):
        hand.command(position=3)
    await hand.halt()
    assert not here.writes
    await hand.activate()
    assert hand.state is State.RUNNING_IDLE
    await hand.activate()
    await hand.move(20, A)


@contract
async def test_another_command_ends_a_move(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    hand.command(A, position=20)
    assert isinstance(await ended(moving), MoveSupersededError)
