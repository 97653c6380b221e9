"""Grasps, and what becomes of the grips."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    Finger,
    GripChange,
    GripEvent,
    GripperFaultError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    State,
    Stream,
)
from robotiq_async.hands import Hand
from tests.contract.bench import A, B, Bench, C, at_rest, contract, ended

GAINED, SLIPPED, LOST, RELEASED = GripChange


async def heard(events: Stream[GripEvent], count: int) -> list[GripEvent]:
    """The next events; they come soon, or not at all."""
    async with asyncio.timeout(5):
        return [await anext(events) for _ in range(count)]


async def next_changes(events: Stream[GripEvent], count: int) -> list[tuple[GripChange, Finger]]:
    """The changes in the next events."""
    return [(event.change, event.finger) for event in await heard(events, count)]


# -- grasps ------------------------------------------------------------------------------------------------


@contract
async def test_a_part_that_every_finger_meets(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    grasp = await hand.grasp(speed=200, force=30)
    assert grasp
    assert grasp.is_held
    assert grasp.holds == Finger.ABC
    assert grasp.at_least == 3
    assert grasp.positions == pytest.approx({A: 150, B: 150, C: 150}, abs=3)
    assert hand.units.mm(grasp.positions[A]) == pytest.approx(60, abs=2)
    assert grasp.status.contacts == Finger.ABC
    assert [(axis.position, axis.speed, axis.force) for axis in here.last_write.axes[:3]] == [
        (255, 200, 30)
    ] * 3


@contract
async def test_a_part_that_two_fingers_meet(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A | B, position=150)
    grasp = await hand.grasp(at_least=2)
    assert grasp.is_held
    assert grasp.holds == A | B
    assert grasp.positions[C] >= 240
    again = await hand.grasp()
    assert not again.is_held
    assert again.holds == A | B


@contract
async def test_nothing_there(here: Bench, hand: Hand) -> None:
    for at_least in (1, None):
        grasp = await hand.grasp(at_least=at_least)
        assert not grasp
        assert grasp.holds == Finger(0)
        assert min(grasp.positions.values()) >= 240
        await hand.open(speed=255)


@contract
async def test_a_contact_while_opening_is_not_held(here: Bench, hand: Hand) -> None:
    await hand.move(200, speed=255)
    here.gripper.place_object(A, 100, opening=True)
    opened = await hand.open()
    assert opened.contacts == A
    grasp = await hand.grasp(A)
    assert not grasp.is_held
    assert grasp.positions[A] >= 240


@contract
async def test_a_thin_part_is_not_seen(here: Bench, hand: Hand) -> None:
    """The gripper holds it and reports no contact (manual)."""
    here.gripper.place_object(Finger.ABC, position=150, thin=True)
    assert not await hand.grasp()


@contract
async def test_a_part_taken_away_still_counts_as_held_until_the_fingers_press_again(
    here: Bench, hand: Hand
) -> None:
    """A contact latches. What the gripper reports is all there is to go by."""
    here.gripper.place_object(Finger.ABC, position=150)
    assert await hand.grasp(force=30)
    here.gripper.remove_object()
    assert await hand.grasp(force=30)
    assert not await hand.grasp(force=31)


@contract
async def test_one_finger_with_the_others_left_as_they_are(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    before = here.travels
    grasp = await hand.grasp(B)
    assert (grasp.holds, grasp.at_least) == (B, 1)
    moved = [after > was for after, was in zip(here.travels, before, strict=True)]
    assert moved == [False, True, False, False]


async def fail(here: Bench, _: Hand) -> None:
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)


async def unplug(here: Bench, _: Hand) -> None:
    here.server.refuse()
    here.server.cut()


async def switch_off_and_on(here: Bench, _: Hand) -> None:
    here.gripper.power_cycle()


INTERRUPTIONS: dict[str, tuple[Callable[[Bench, Hand], Awaitable[Any]], type[Exception]]] = {
    "another command": (lambda _, hand: hand.set_position(10, A), MoveSupersededError),
    "a halt": (lambda _, hand: hand.halt(), MoveSupersededError),
    "a reset": (lambda _, hand: hand.reset(), MoveSupersededError),
    "a fault": (fail, GripperFaultError),
    "a lost link": (unplug, ConnectionLostError),
    "the power": (switch_off_and_on, NotActivatedError),
    "the stop": (lambda _, hand: hand.stop(), NotStartedError),
}


@contract
@pytest.mark.parametrize("what", INTERRUPTIONS)
async def test_a_grasp_that_is_interrupted(here: Bench, hand: Hand, what: str) -> None:
    interrupt, error = INTERRUPTIONS[what]
    grasping = await here.moving(hand.grasp(speed=0))
    await interrupt(here, hand)
    assert isinstance(await ended(grasping), error)
    await here.server.accept()


@contract
@pytest.mark.parametrize("how", ["cancelled", "too slow"])
async def test_a_grasp_that_is_given_up_holds_what_moves_and_keeps_the_grip(
    here: Bench, hand: Hand, how: str
) -> None:
    here.gripper.place_object(A, position=30)
    grasping = asyncio.create_task(hand.grasp(speed=0, timeout=None if how == "cancelled" else 0.5))
    async for status in hand.statuses():
        if status.contacts:
            break
    if how == "cancelled":
        grasping.cancel()
    error = asyncio.CancelledError if how == "cancelled" else MoveTimeoutError
    assert isinstance(await ended(grasping), error)
    await at_rest(hand)
    assert here.last_write.position(A) == 255, "the grip stays"
    assert here.gripper.position(B) < 100


# -- what becomes of a grip --------------------------------------------------------------------------------


@contract
async def test_a_contact_is_an_event_as_soon_as_it_is_made(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=60)
    here.gripper.place_object(B, position=150)
    events = hand.grip_events()
    grasp = await hand.grasp(at_least=2)
    first, second = await heard(events, 2)
    assert (first.change, first.finger, first.holds) == (GAINED, A, A)
    assert (second.change, second.finger, second.holds) == (GAINED, B, A | B)
    assert first.position == grasp.positions[A]
    assert first.timestamp < second.timestamp
    assert events.take_nowait() is None


@contract
async def test_a_part_that_is_pulled_out_is_noticed_when_the_fingers_try_again(
    here: Bench, hand: Hand
) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    grasp = await hand.grasp(force=30)
    events = hand.grip_events(since=grasp.status)
    here.gripper.remove_object(A)
    await asyncio.sleep(1)
    assert [*events.drain()] == [], "the contact latches"
    await hand.set_force(60)
    slipped, lost = await heard(events, 2)
    assert (slipped.change, slipped.finger, slipped.holds) == (SLIPPED, A, B | C)
    assert slipped.moved > 3
    assert (lost.change, lost.finger, lost.holds) == (LOST, A, B | C)
    assert lost.position >= 240
    assert [*events.drain()] == [], "B and C pressed again and did not move"


@contract
async def test_a_part_that_slips_and_is_held_again(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=150)
    grasp = await hand.grasp(A, force=30)
    events = hand.grip_events(A, since=grasp.status)
    here.gripper.place_object(A, position=180)
    await hand.set_force(60)
    assert await next_changes(events, 2) == [(SLIPPED, A), (GAINED, A)]


@contract
async def test_opening_releases_the_part_and_a_reset_loses_it(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    for let_go, change in ((hand.open, RELEASED), (hand.reset, LOST)):
        grasp = await hand.grasp()
        events = hand.grip_events(since=grasp.status)
        await let_go()
        assert await next_changes(events, 3) == [(change, A), (change, B), (change, C)]
        assert not events.take_nowait()
    await hand.activate()


@contract
async def test_events_begin_with_the_newest_status_or_the_one_given(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=150)
    grasp = await hand.grasp(A)
    await hand.open(A)
    assert await next_changes(hand.grip_events(A, since=grasp.status), 1) == [(RELEASED, A)]
    events = hand.grip_events(A)
    await asyncio.sleep(0.2)
    assert events.take_nowait() is None, "it begins with the newest status"


@contract
async def test_a_finger_that_presses_again_after_a_fault_has_kept_its_grip(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=60)
    grasping = asyncio.create_task(hand.grasp(speed=0))
    events = hand.grip_events()
    assert await next_changes(events, 1) == [(GAINED, A)]
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    assert isinstance(await ended(grasping), GripperFaultError)
    await hand.wait_for_state(State.RUNNING_IDLE)
    await at_rest(hand)
    assert hand.status.contacts == A
    assert events.take_nowait() is None


@contract
async def test_the_link_is_lost_and_comes_back(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(Finger.ABC, position=150)
    grasp = await hand.grasp()
    events = hand.grip_events(since=grasp.status)
    await here.unplug(hand)
    here.gripper.power_cycle()
    await asyncio.sleep(0.5)
    assert events.take_nowait() is None, "nothing is known"
    late = hand.grip_events()
    await here.server.accept()
    for each in (events, late):
        assert await next_changes(each, 3) == [(LOST, A), (LOST, B), (LOST, C)]


@contract
async def test_it_begins_before_the_start_and_ends_after_the_stop(here: Bench) -> None:
    hand = here.make()
    events = hand.grip_events()
    here.gripper.place_object(A, position=150)
    async with hand:
        await hand.grasp()
    assert await next_changes(events, 1) == [(GAINED, A)]
    assert [event async for event in events] == [], "the stop ends no contact"
    closed = here.make().grip_events()
    await closed.aclose()
    with pytest.raises(StopAsyncIteration):
        await anext(closed)


@contract
async def test_a_cancelled_wait_for_an_event_loses_nothing(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(A, position=60)
    events = hand.grip_events(A)
    waiting = asyncio.ensure_future(anext(events))
    await asyncio.sleep(0.1)
    waiting.cancel()
    await asyncio.wait({waiting})
    await hand.grasp(A)
    assert await next_changes(events, 1) == [(GAINED, A)]
    assert events.missed == 0
