"""Faults, resets, releases, and the way out."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    Fault,
    GripperFaultError,
    InvalidStateError,
    State,
    StateTimeoutError,
)
from robotiq_async.hands import Hand
from tests.contract.bench import A, Bench, at_rest, contract, ended


@contract
async def test_a_minor_fault_ends_a_move_and_nothing_resumes(here: Bench, hand: Hand) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    error = await ended(moving)
    assert isinstance(error, GripperFaultError)
    assert error.fault is Fault.COMMUNICATION_NOT_READY
    await hand.wait_for_state(State.RUNNING_IDLE)
    at = here.gripper.position(A)
    await at_rest(hand)
    assert here.gripper.position(A) == pytest.approx(at, abs=2)


@contract
@pytest.mark.parametrize("fault", [Fault.SCISSOR_BLOCKED, 0x0C])
async def test_a_major_fault(here: Bench, hand: Hand, fault: int) -> None:
    moving = await here.moving(hand.move(255, speed=0))
    here.gripper.inject_fault(fault)
    await hand.wait_for_state(State.FAULT)
    assert hand.state is State.FAULT
    assert hand.status.fault == fault, "the status that shows it is there"
    for error in (
        await ended(moving),
        await ended(asyncio.create_task(hand.move(3))),
        await ended(asyncio.create_task(hand.activate())),
    ):
        assert isinstance(error, GripperFaultError)
        assert error.fault is Fault(fault)
        assert str(error)
    with pytest.raises(GripperFaultError) as caught:
        hand.command(position=3)
    assert caught.value.fault is Fault(fault)
    if Fault(fault).is_known:
        await hand.recover()
    else:  # nothing but a person decides to reset it
        await hand.reset()
        await hand.activate()
    assert hand.state is State.RUNNING_IDLE
    await hand.move(60, A)


@contract
async def test_recover_waits_for_a_minor_fault_and_writes_nothing(here: Bench, hand: Hand) -> None:
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2.0)
    await hand.wait_for_state(State.FAULT)
    writes = here.writes
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    assert here.writes == writes


@contract
@pytest.mark.parametrize("code", [0x01, 0x02, 0x04, 0x08, 0x0C])
async def test_recover_waits_for_a_fault_that_no_manual_names_and_drops_no_part(
    here: Bench, hand: Hand, code: int
) -> None:
    here.gripper.inject_fault(code)
    await hand.wait_for_state(State.FAULT)
    writes = here.writes
    with pytest.raises(StateTimeoutError, match=rf"0x{code:02X}.*reset\(\) may clear it, and DROPS the part"):
        await hand.recover(timeout=0.3)
    assert here.writes == writes
    recovering = asyncio.create_task(hand.recover())
    await asyncio.sleep(0)
    here.gripper.clear_faults()
    await recovering
    assert hand.state is State.RUNNING_IDLE
    assert here.writes == writes


@contract
async def test_recover_gives_up_in_time(here: Bench, hand: Hand) -> None:
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    await hand.wait_for_state(State.FAULT)
    began = asyncio.get_running_loop().time()
    with pytest.raises(StateTimeoutError):
        await hand.recover(timeout=0.5)
    assert 0.4 < asyncio.get_running_loop().time() - began < 0.7


@contract
async def test_recover_while_running_does_nothing(here: Bench, hand: Hand) -> None:
    writes = here.writes
    await hand.recover()
    assert here.writes == writes


@contract
async def test_a_release_only_in_fault(here: Bench, hand: Hand) -> None:
    with pytest.raises(InvalidStateError) as caught:
        await hand.atr()
    assert caught.value.state is State.RUNNING_IDLE
    assert caught.value.allowed == {State.FAULT}


@contract
async def test_release_reset_activate(here: Bench, hand: Hand) -> None:
    await hand.move(150)
    here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await hand.wait_for_state(State.FAULT)
    await hand.atr()
    assert hand.state is State.ATR_DONE
    assert here.gripper.position(A) < 20
    with pytest.raises(GripperFaultError):
        await hand.set_position(3)
    with pytest.raises(GripperFaultError):
        hand.command(position=3)
    await hand.reset()
    assert hand.state is State.RESET
    assert hand.is_reset
    await hand.activate()
    assert hand.state is State.RUNNING_IDLE
    assert hand.is_activated


@contract
async def test_an_emergency_release(here: Bench, hand: Hand) -> None:
    here.gripper.emergency_release()
    await hand.wait_for_state(State.ATR_DONE)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE


@contract(active=False)
async def test_a_cancelled_activation_goes_on(here: Bench, hand: Hand) -> None:
    activating = await here.moving(hand.activate())
    activating.cancel()
    await ended(activating)
    assert await hand.wait_for_state(State.RUNNING_IDLE, timeout=20) is State.RUNNING_IDLE


@contract(active=False)
async def test_a_command_during_an_activation(here: Bench, hand: Hand) -> None:
    activating = asyncio.create_task(hand.activate())
    await hand.wait_for_state(State.WF_ACTIVATION)
    with pytest.raises(InvalidStateError) as caught:
        hand.command(position=3)
    assert caught.value.state is State.WF_ACTIVATION
    assert State.RUNNING_IDLE in caught.value.allowed
    assert str(caught.value).endswith(
        "activate() waits for it, and recover() also resets a gripper that is stuck"
    )
    with pytest.raises(InvalidStateError) as awaited:
        await hand.set_position(3)
    assert str(awaited.value) == str(caught.value)
    assert awaited.value.allowed == caught.value.allowed
    await activating


@contract
async def test_a_foreign_reset(here: Bench, hand: Hand) -> None:
    here.gripper.write(0, [0] * 8)
    await hand.wait_for_state(State.RESET)
    assert hand.is_reset
    assert not hand.is_activated
    await hand.activate()
