"""wait_for_state()."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Fault, NotStartedError, State, StateTimeoutError
from robotiq_async.hands import Hand
from tests.contract.bench import Bench, contract, ended


@contract
async def test_a_state_that_it_is_in(here: Bench, hand: Hand) -> None:
    assert await hand.wait_for_state(State.FAULT, State.RUNNING_IDLE) is State.RUNNING_IDLE
    with pytest.raises(ValueError, match=r"^timeout must be"):
        await hand.wait_for_state(State.RUNNING_IDLE, timeout=0)


@contract
async def test_not_in_time(here: Bench, hand: Hand) -> None:
    began = asyncio.get_running_loop().time()
    with pytest.raises(StateTimeoutError, match=r"FAULT or RESET was not reached within 0.1 s"):
        await hand.wait_for_state(State.FAULT, State.RESET, timeout=0.1)
    assert asyncio.get_running_loop().time() - began == pytest.approx(0.1, abs=0.01)


@contract
async def test_a_state_that_lasts_for_a_moment(here: Bench, hand: Hand) -> None:
    waiting = [
        asyncio.create_task(hand.wait_for_state(state))
        for state in (State.RUNNING_CC, State.DO_RESET, State.WF_RESET, State.DO_ACTIVATION)
    ]
    await asyncio.sleep(0)
    hand.command(speed=5)
    assert await waiting[0] is State.RUNNING_CC
    await hand.reset()
    await hand.activate()
    assert [await each for each in waiting[1:]] == [State.DO_RESET, State.WF_RESET, State.DO_ACTIVATION]


@contract
async def test_the_state_and_what_it_comes_from_are_there(here: Bench, hand: Hand) -> None:
    for _ in range(5):
        here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
        await hand.wait_for_state(State.FAULT)
        assert hand.state is State.FAULT
        assert hand.status.fault is Fault.COMMUNICATION_NOT_READY
        await hand.wait_for_state(State.RUNNING_IDLE)
        assert hand.state is State.RUNNING_IDLE
        assert hand.status.fault is Fault.NONE


@contract
async def test_it_ends_with_stop(here: Bench) -> None:
    async with here.make() as hand:
        waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
        shutdown = asyncio.create_task(hand.wait_for_state(State.SHUTDOWN))
        going = asyncio.create_task(hand.wait_for_state(State.DO_SHUTDOWN))
        await asyncio.sleep(0)
    assert isinstance(await ended(waiting), NotStartedError)
    assert await shutdown is State.SHUTDOWN
    assert await going is State.DO_SHUTDOWN
    with pytest.raises(NotStartedError):
        await hand.wait_for_state(State.RUNNING_IDLE)


@contract(active=False)
async def test_a_stop_ends_every_wait(here: Bench, hand: Hand) -> None:
    await hand.activate()
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    await hand.wait_for_state(State.FAULT)
    recovering = asyncio.create_task(hand.recover())
    waiting = asyncio.create_task(hand.wait_for_state(State.RESET))
    await asyncio.sleep(0.1)
    await hand.stop()
    assert isinstance(await ended(recovering), NotStartedError)
    assert isinstance(await ended(waiting), NotStartedError)


@contract(active=False)
async def test_an_activation_that_is_awaited_when_it_stops_ends(here: Bench, hand: Hand) -> None:
    activating = await here.moving(hand.activate())
    await hand.stop()
    assert isinstance(await ended(activating), NotStartedError)
    assert not here.gripper.is_moving


@contract
async def test_a_cancelled_wait_leaves_nothing(here: Bench, hand: Hand) -> None:
    waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
    await asyncio.sleep(0)
    waiting.cancel()
    assert isinstance(await ended(waiting), asyncio.CancelledError)
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.1)
    await hand.wait_for_state(State.FAULT)
