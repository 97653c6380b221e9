"""Observations of a hand: state, status, statistics, and its motion."""

from __future__ import annotations

import asyncio
import itertools
import logging

import pytest

from robotiq_async import ConnectionLostError, NotStartedError, RobotiqError, RobotiqStatus, State
from robotiq_async.hands import Hand
from tests.calls import COMMANDS, called
from tests.contract.bench import A, Bench, at_rest, contract, ended, statuses

PROPERTIES = ("is_moving", "is_activated", "is_reset")


@contract
async def test_it_is_called_by_its_address_unless_it_was_given_a_name(here: Bench) -> None:
    hand = here.make()
    assert hand.name == hand.address
    assert hand.name in repr(hand)


@contract
async def test_every_line_of_the_log_tells_its_hand(here: Bench, caplog: pytest.LogCaptureFixture) -> None:
    with caplog.at_level(logging.DEBUG, "robotiq_async"):
        async with here.make() as hand:
            hand.command(position=50)
            await here.unplug(hand)
            await here.plug(hand)
    # An agent calls its hands by their names in its file.
    known = {hand.name if here.lab is None else "left", here.server.address}
    records = [each for each in caplog.records if each.name == "robotiq_async"]
    assert len(records) > 5
    for record in records:
        assert record.__dict__["hand"] in known | {hand.name}
        assert record.getMessage().startswith(f"{record.__dict__['hand']}: ")
    assert {record.__dict__["hand"] for record in records} >= known


@contract
async def test_before_the_start_nothing_is_known(here: Bench) -> None:
    hand = here.make()
    assert hand.state is State.DISCONNECTED
    for name in ("status", *PROPERTIES):
        with pytest.raises(NotStartedError):
            getattr(hand, name)
    assert hand.statistics.polls == 0


@contract
async def test_after_the_stop_only_the_last_status(here: Bench) -> None:
    async with here.make() as hand:
        await hand.move(100, A)
    assert hand.state is State.SHUTDOWN
    assert hand.status.position(A) == pytest.approx(100, abs=2)
    for name in PROPERTIES:
        with pytest.raises(NotStartedError):
            getattr(hand, name)


@contract
async def test_while_the_link_is_down(here: Bench, hand: Hand) -> None:
    await hand.move(50, A)
    await here.unplug(hand)
    assert hand.state is State.DISCONNECTED
    assert hand.status.position(A) == pytest.approx(50, abs=2)
    for name in PROPERTIES:
        with pytest.raises(ConnectionLostError):
            getattr(hand, name)
    for command in COMMANDS:
        with pytest.raises(ConnectionLostError):
            await called(hand, command)
    writes = here.writes
    await here.plug(hand)
    await at_rest(hand)
    assert here.writes == writes, "nothing is sent later"
    await hand.move(30, A)


@contract
async def test_a_lost_link_ends_a_move(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    await here.unplug(hand)
    assert isinstance(await ended(moving), ConnectionLostError)
    await here.plug(hand)


@contract
async def test_the_newest_status(here: Bench, hand: Hand) -> None:
    async for status in hand.statuses():
        assert status is hand.status
        assert isinstance(status, RobotiqStatus)
        if status.sequence > 50:
            break


@contract
async def test_it_moves_from_the_call_until_the_end_of_a_move(here: Bench, hand: Hand) -> None:
    moving = asyncio.create_task(hand.move(100, A))
    await asyncio.sleep(0)
    assert hand.is_moving
    stream = hand.statuses()
    while not moving.done():
        await anext(stream)
        assert hand.is_moving or moving.done() or not here.gripper.is_moving
    await moving
    assert not hand.is_moving


@contract
async def test_timestamps_are_of_this_process_and_only_rise(here: Bench, hand: Hand) -> None:
    now = asyncio.get_running_loop().time
    stream, transitions, requests = hand.statuses(buffer=10_000), hand.transitions(), hand.requests()
    began = now()
    for value in (20, 100, 30):
        await hand.move(value, A)
        assert 0 <= now() - hand.status.timestamp < 0.05
    stamps = [status.timestamp for status in stream.drain()]
    assert len(stamps) > 30
    assert all(before < after for before, after in itertools.pairwise(stamps))
    for times in (
        [each.timestamp for each in transitions.drain()],
        [each.timestamp for each in requests.drain()],
    ):
        assert times == sorted(times)
        assert began - 0.01 <= times[0] <= times[-1] <= now()


@contract
async def test_statistics(here: Bench, hand: Hand) -> None:
    before = hand.statistics
    await hand.move(60)
    here.gripper.place_object(A, 150)
    await hand.move(255)
    moving = await here.moving(hand.move(0, speed=0))
    moving.cancel()
    await ended(moving)
    await asyncio.sleep(1.1)
    statistics = hand.statistics
    assert statistics.polls > before.polls + 100
    assert statistics.writes >= before.writes + 4
    assert statistics.moves == {"reached": 1, "contact": 1, "cancelled": 1}
    assert 0.004 < statistics.period_p50 < 0.006
    assert 0 < statistics.round_trip_p50 <= statistics.round_trip_p99
    assert statistics.reconnects == statistics.foreign_commands == statistics.faults == 0
    assert len(await statuses(hand, 3)) == 3


@contract(active=False)
async def test_no_axis_moves_while_is_moving_is_false(here: Bench) -> None:
    """In no state, and in no procedure; or it raises."""
    axes, states, unseen = here.gripper.model.axes, set(), []

    async def watch(hand: Hand) -> None:
        is_moving, travels = False, [here.gripper.travel(axis) for axis in axes]
        while True:
            before, travels = travels, [here.gripper.travel(axis) for axis in axes]
            states.add(hand.state)
            if travels != before and not is_moving:
                unseen.append(hand.state)
            try:
                is_moving = hand.is_moving
            except RobotiqError:
                is_moving = True
            await asyncio.sleep(0.001)

    hand = here.make()
    watching = asyncio.create_task(watch(hand))
    await hand.start()
    await hand.move(200, A)
    moving = asyncio.create_task(hand.move(20, A))
    await asyncio.sleep(0.05)
    await hand.hold()
    await ended(moving)
    hand.command(A, position=200)
    await asyncio.sleep(0.05)
    await hand.halt()
    await hand.move(100, A)
    here.gripper.inject_fault(0x0E)
    await hand.wait_for_state(State.FAULT)
    await hand.atr()
    await hand.recover()
    assert not unseen
    await hand.move(100, A)  # so that the release has a way to go on every model
    here.gripper.emergency_release()
    await hand.wait_for_state(State.FAULT)
    await asyncio.sleep(0.002)
    unseen.clear()  # until a status showed it, nothing could tell
    await hand.halt()
    activating = asyncio.create_task(hand.activate())
    await hand.wait_for_state(State.WF_ACTIVATION)
    await asyncio.sleep(0.05)
    await hand.stop()
    await ended(activating)
    watching.cancel()
    assert not unseen
    assert states >= {State.RUNNING_IDLE, State.FAULT, State.WF_ATR, State.WF_ACTIVATION}
