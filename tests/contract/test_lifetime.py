"""The life of a hand from start() to stop(), and again."""

from __future__ import annotations

import asyncio
import contextlib
from typing import cast

import pytest

from robotiq_async import (
    ConnectFailedError,
    Fault,
    GripperFaultError,
    InvalidStateError,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.fleet.network.bus import Bus
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.hands import Hand
from tests.calls import COMMANDS, called
from tests.contract.bench import LOCAL, REMOTE, A, B, Bench, C, contract, ended, statuses
from tests.virtual import until


@pytest.mark.parametrize("where", [LOCAL, REMOTE])
def test_constructing_needs_no_loop(where: str) -> None:
    hand: Hand = (
        RobotiqHand("tcp://192.0.2.1")
        if where == LOCAL
        else RemoteHand("zenoh://lab/cell/left", bus=cast("Bus", object()))
    )
    assert hand.state is State.DISCONNECTED
    assert hand.address in repr(hand)
    assert hand.statistics.polls == 0


@contract
async def test_an_active_gripper_is_adopted_and_nothing_is_written(here: Bench) -> None:
    writes, travels = here.writes, here.travels
    async with here.make() as hand:
        assert hand.state is State.RUNNING_IDLE
        assert hand.is_activated
        assert not hand.is_reset
        assert not hand.is_moving
        await statuses(hand, 20)
        assert (here.writes, here.travels) == (writes, travels)
    assert hand.state is State.SHUTDOWN


@contract(active=False)
async def test_a_reset_gripper_is_activated(here: Bench) -> None:
    async with here.make() as hand:
        assert hand.state is State.RUNNING_IDLE
        assert hand.is_activated


@contract(active=False)
async def test_without_activation_nothing_is_written(here: Bench, hand: Hand) -> None:
    assert hand.state is State.RESET
    assert hand.is_reset
    await hand.stop(halt=False)
    assert not here.writes


@contract
async def test_one_in_fault_is_left_there(here: Bench) -> None:
    here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await asyncio.sleep(0.1)
    writes = here.writes
    async with here.make() as hand:
        await statuses(hand, 10)
        assert hand.state is State.FAULT
        assert here.writes == writes
        assert hand.statistics.foreign_commands == 0


@contract
async def test_a_released_gripper_is_left_released(here: Bench) -> None:
    async with here.make() as hand:
        here.gripper.emergency_release()
        await hand.wait_for_state(State.ATR_DONE)
    async with here.make() as hand:
        assert hand.state is State.ATR_DONE
        await hand.recover()
        assert hand.state is State.RUNNING_IDLE


@contract(active=False)
async def test_an_activation_under_way_is_waited_for(here: Bench, hand: Hand) -> None:
    activating = await here.moving(hand.activate())
    activating.cancel()
    await ended(activating)
    await hand.stop(halt=False)
    assert here.gripper.is_moving
    async with here.make() as second:
        assert second.state is State.RUNNING_IDLE
        assert second.is_activated


@contract(active=False)
async def test_an_activation_that_ends_in_a_fault_fails_the_start(here: Bench) -> None:
    here.gripper.fail_activation = True
    hand = here.make()
    with pytest.raises(GripperFaultError) as caught:
        await hand.start()
    assert caught.value.fault is Fault.ACTIVATION_FAULT
    assert hand.state is State.SHUTDOWN
    await until(lambda: not here.gripper.request_registers[0] & 0x0100)
    await hand.start(activate=False)
    assert hand.state is State.RESET, "its activation is taken back, or it might go on as the fault clears"
    here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await hand.wait_for_state(State.FAULT)
    await hand.stop()
    await hand.start()
    assert hand.state is State.FAULT, "one that is there already is not start()'s business"
    here.gripper.clear_faults()
    await hand.wait_for_state(State.RESET)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


@contract
async def test_starting_twice_is_refused_and_changes_nothing(here: Bench, hand: Hand) -> None:
    with pytest.raises(InvalidStateError) as caught:
        await hand.start()
    assert caught.value.state is State.RUNNING_IDLE
    await hand.move(50, A)


@contract
async def test_starting_twice_at_once_is_refused(here: Bench) -> None:
    hand = here.make()
    first, second = await asyncio.gather(hand.start(), hand.start(), return_exceptions=True)
    assert (first, type(second)) == (None, InvalidStateError)
    await hand.move(50, A)
    await hand.stop()


@contract
async def test_it_may_be_started_again(here: Bench) -> None:
    hand, newest = here.make(), -1
    for _ in range(3):
        await hand.start()
        assert hand.status.sequence > newest, "sequences go on"
        await hand.move(50, A)
        newest = hand.status.sequence
        await hand.stop()
        assert hand.state is State.SHUTDOWN
        assert hand.status.sequence >= newest, "the last status stays"
    assert hand.statistics.foreign_commands == 0


@contract
async def test_stop_stops_the_fingers_and_keeps_the_activation(here: Bench) -> None:
    async with here.make() as hand:
        await hand.set_position(255)
        await here.moves()
    assert (here.last_write.activate, here.last_write.go) == (True, False)
    assert not here.gripper.is_moving
    await hand.stop()
    await hand.stop()


@contract
async def test_stop_may_leave_the_fingers_to_what_they_do(here: Bench, hand: Hand) -> None:
    await hand.set_position(200)
    await here.moves()
    writes = here.writes
    await hand.stop(halt=False)
    await asyncio.sleep(2)
    assert here.writes == writes
    assert here.gripper.position(A) >= 195


@contract
async def test_stop_may_keep_a_grip(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(B | C, 100)
    await hand.close(B | C)
    writes = here.writes
    await hand.stop(keep_grip=True)
    assert hand.state is State.SHUTDOWN
    await asyncio.sleep(1)
    assert here.gripper.grips == B | C
    assert here.writes == writes


@contract
async def test_a_stop_that_keeps_a_grip_holds_what_moves(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(B | C, 100)
    await hand.close(B | C)
    await hand.set_speed(0, A)
    await hand.set_position(255, A)
    await here.moves()
    await hand.stop(keep_grip=True)
    assert not here.gripper.is_moving
    await asyncio.sleep(1)
    assert here.gripper.position(A) < 40
    assert here.gripper.grips == B | C


@contract
async def test_in_a_fault_no_grip_is_kept(here: Bench, hand: Hand) -> None:
    here.gripper.place_object(B | C, 100)
    await hand.close(B | C)
    here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    await hand.wait_for_state(State.FAULT)
    await hand.stop(keep_grip=True)
    assert not here.last_write.go


@contract
async def test_stop_before_any_start(here: Bench) -> None:
    await here.make().stop()


@contract
async def test_every_caller_of_stop_waits_until_the_hand_has_stopped(here: Bench, hand: Hand) -> None:
    await hand.set_position(255)
    await here.moves()

    async def stop() -> bool:
        await hand.stop()
        return here.gripper.is_moving

    assert await asyncio.gather(*(stop() for _ in range(3))) == [False] * 3


@contract
async def test_a_start_right_after_a_stop_that_was_not_waited_for(here: Bench, hand: Hand) -> None:
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    with pytest.raises(InvalidStateError):
        await hand.start()
    await stopping
    assert hand.state is State.SHUTDOWN


@contract
async def test_a_cancelled_stop_still_stops(here: Bench, hand: Hand) -> None:
    await hand.set_position(255)
    await here.moves()
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    stopping.cancel()
    assert isinstance(await ended(stopping), asyncio.CancelledError)
    assert hand.state is State.SHUTDOWN
    assert not here.gripper.is_moving


@contract(active=False)
async def test_a_stop_while_it_starts_ends_the_start(here: Bench) -> None:
    hand = here.make()
    starting = asyncio.create_task(hand.start())
    await asyncio.sleep(0)
    await hand.stop()
    assert isinstance(await ended(starting), NotStartedError)
    assert hand.state is State.SHUTDOWN
    await asyncio.sleep(1)
    assert not here.gripper.is_moving


@contract(active=False)
async def test_a_cancelled_start_takes_its_activation_back(here: Bench) -> None:
    hand = here.make()
    starting = await here.moving(hand.start())
    starting.cancel()
    assert isinstance(await ended(starting), asyncio.CancelledError)
    assert hand.state is State.SHUTDOWN
    assert not here.gripper.is_moving
    assert not here.last_write.activate
    await hand.start(activate=False)
    assert hand.state is State.RESET
    await hand.stop()


@contract
async def test_leaving_through_an_exception_stops_the_fingers(here: Bench) -> None:
    async def fail() -> None:
        async with here.make() as hand:
            await hand.set_position(255)
            await here.moves()
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()
    assert not here.gripper.is_moving


@contract
async def test_leaving_by_cancellation_stops_the_fingers(here: Bench) -> None:
    with contextlib.suppress(TimeoutError):
        async with asyncio.timeout(0.5), here.make() as hand:
            await hand.move(255, speed=0)
    assert not here.gripper.is_moving


@contract
async def test_nothing_answers(here: Bench) -> None:
    hand = here.make()
    if here.lab is None:
        here.server.refuse()
        here.server.cut()
    else:
        await here.lab.end_agent()
    with pytest.raises(ConnectFailedError) as caught:
        await hand.start()
    assert caught.value.address == hand.address
    assert hand.state is State.SHUTDOWN


@contract
async def test_calls_before_the_start_are_refused_and_have_no_later_effect(here: Bench) -> None:
    hand = here.make()
    for _ in range(2):
        for call in (*COMMANDS, "wait_for_state"):
            with pytest.raises(NotStartedError):
                await called(hand, call)
        await hand.start()
        await hand.stop()


@contract
@pytest.mark.parametrize("value", [1, None, "yes"])
async def test_flags_are_flags(here: Bench, value: object) -> None:
    hand = here.make()
    with pytest.raises(TypeError, match="activate"):
        await hand.start(activate=value)  # type: ignore[arg-type]
    with pytest.raises(TypeError, match="halt"):
        await hand.stop(halt=value)  # type: ignore[arg-type]
    if value is not None:  # what the hand was made with
        with pytest.raises(TypeError, match="keep_grip"):
            await hand.stop(keep_grip=value)  # type: ignore[arg-type]


@contract
async def test_a_start_waits_for_a_gripper_that_has_no_power_yet(here: Bench) -> None:
    hand, starting = await starting_without_power(here, wait=60.0)
    await here.server.accept()
    async with asyncio.timeout(5.0):
        await starting
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


@contract
@pytest.mark.parametrize("how", ["stop", "cancel"])
async def test_the_wait_of_a_start_ends_at_once(here: Bench, how: str) -> None:
    hand, starting = await starting_without_power(here, wait=3600.0)
    began = asyncio.get_running_loop().time()
    await hand.stop() if how == "stop" else starting.cancel()
    error = await ended(starting)
    assert isinstance(error, asyncio.CancelledError if how == "cancel" else NotStartedError)
    assert asyncio.get_running_loop().time() - began <= 2.0
    await hand.stop()


async def starting_without_power(here: Bench, wait: float) -> tuple[Hand, asyncio.Task[None]]:
    """A hand that has been waiting for its gripper for 8 s; a start that does not wait gives up after 5."""
    here.server.refuse()
    here.server.cut()
    await until(lambda: here.lab is None or here.lab.local.state is State.DISCONNECTED)
    hand = here.make()
    starting = asyncio.create_task(hand.start(activate=False, wait=wait))
    await asyncio.sleep(8.0)
    assert not starting.done()
    return hand, starting
