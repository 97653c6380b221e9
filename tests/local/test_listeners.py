"""add_listener(): what it is called with, when, and for how long."""

from __future__ import annotations

import asyncio
import logging
from typing import Any

import pytest

from robotiq_async import (
    Finger,
    MoveSupersededError,
    NotStartedError,
    RobotiqHand,
    RobotiqStatus,
    SentRequest,
    State,
    Transition,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import Request
from tests.fake_transport import Wire
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop

A = Finger.A


async def test_a_listener_gets_the_items_of_all_streams(hand: RobotiqHand) -> None:
    heard: list[Any] = []
    statuses, transitions, requests = hand.statuses(1000), hand.transitions(), hand.requests()
    remove = hand.add_listener(heard.append)
    await hand.move(60, A)
    await hand.stop()
    remove()
    for kind, items in (
        (RobotiqStatus, [*statuses.drain()]),
        (Transition, [*transitions.drain()]),
        (SentRequest, [*requests.drain()]),
    ):
        assert [each for each in heard if type(each) is kind] == items, kind
    first = next(index for index, each in enumerate(heard) if isinstance(each, SentRequest))
    asked, *between, delivered, request = heard[: first + 1]
    assert (asked.target, delivered.target) == (State.RUNNING_CC, State.RUNNING_IDLE)
    assert {type(each) for each in between} == {RobotiqStatus}
    assert request.acknowledged


async def test_it_is_called_before_any_reader_and_any_caller_goes_on(hand: RobotiqHand) -> None:
    order: list[str] = []

    def listen(item: object) -> None:
        if isinstance(item, RobotiqStatus):
            assert item is hand.status
            order.append(f"told {item.sequence}")
        elif isinstance(item, SentRequest):
            order.append("told of the request")

    async def read() -> None:
        async for status in hand.statuses():
            order.append(f"read {status.sequence}")  # noqa: PERF401  # as it comes

    async def ask() -> None:
        await hand.set_position(30, A)
        order.append("acknowledged")

    remove = hand.add_listener(listen)
    reading = asyncio.create_task(read())
    await ask()
    result = await hand.move(255, A, speed=0)
    order.append(f"moved {result.status.sequence}")
    reading.cancel()
    assert sum(each.startswith("read") for each in order) > 2
    remove()
    assert order.index("told of the request") < order.index("acknowledged")
    for what in [each for each in order if each.startswith(("read", "moved"))]:
        assert order.index(f"told {what.split()[1]}") < order.index(what)


@pytest.mark.virtual_time
async def test_a_command_of_a_listener_goes_out_in_the_same_turn(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    """It is decided on the status that the listener was called with."""
    heard: list[object] = []

    def listen(item: object) -> None:
        heard.append(item)
        if len(heard) == 1:
            hand.command(A, position=100)

    remove = hand.add_listener(listen)
    await hand.wait_for_state(State.RUNNING_CC)
    await hand.wait_for_state(State.RUNNING_IDLE)
    remove()
    kinds = [type(each) for each in heard[:4]]
    assert kinds[0] is RobotiqStatus
    assert kinds.count(RobotiqStatus) == 1, "no other status came between"
    assert SentRequest in kinds


async def test_a_command_of_a_listener_comes_after_the_one_that_it_is_called_for(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    """Called in the middle of that one, its own command was overwritten without a word."""
    seen: list[State] = []

    def listen(item: object) -> None:
        if isinstance(item, Transition):
            seen.append(item.target)
            if item.target is State.RUNNING_CC and len(seen) == 1:
                hand.command(A, position=30)

    remove = hand.add_listener(listen)
    with pytest.raises(MoveSupersededError):
        await hand.move(200, A)
    await hand.wait_for_state(State.RUNNING_IDLE)
    remove()
    assert gripper.writes[-1].registers[1] & 0xFF == 30


async def test_a_stop_that_a_listener_asks_for_is_final(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    stopping: list[asyncio.Task[None]] = []
    states: list[State] = []

    def listen(item: object) -> None:
        if isinstance(item, Transition):
            states.append(item.target)
        if isinstance(item, Transition) and item.target is State.RUNNING_CC:
            stopping.append(asyncio.create_task(hand.stop()))

    remove = hand.add_listener(listen)
    writes = len(gripper.writes)
    with pytest.raises(NotStartedError):
        await hand.move(200, A)
    await stopping[0]
    remove()
    assert len(gripper.writes) == writes
    assert states == [State.RUNNING_CC, State.DO_SHUTDOWN, State.SHUTDOWN]


async def test_a_listener_added_before_the_start_outlasts_the_stop(server: SimulatorServer) -> None:
    hand, targets = RobotiqHand(server.address), []
    remove = hand.add_listener(
        lambda each: targets.append(each.target) if isinstance(each, Transition) else None
    )
    for _ in range(2):
        await hand.start(activate=False)
        await hand.stop()
    assert targets.count(State.SHUTDOWN) == 2
    remove()
    count = len(targets)
    await hand.start(activate=False)
    await hand.stop()
    assert len(targets) == count


async def test_a_listener_that_raises_does_not_end_the_hand(
    hand: RobotiqHand, caplog: pytest.LogCaptureFixture
) -> None:
    def fail(item: object) -> None:
        raise ZeroDivisionError

    with caplog.at_level(logging.ERROR, logger="robotiq_async"):
        hand.add_listener(fail)
        await hand.move(40, A)
    assert [record.levelno for record in caplog.records] == [logging.ERROR]
    assert hand.state is State.RUNNING_IDLE


@pytest.mark.parametrize("error", [SystemExit, KeyboardInterrupt])
def test_a_listener_that_ends_the_program_at_every_item_leaves_the_fingers_stopped(
    error: type[BaseException],
) -> None:
    """It ended the stop of the fingers, too: rGTO stayed set after the program."""
    grippers: list[SimulatedGripper] = []

    def end(item: object) -> None:
        if grippers[0].is_moving:
            raise error

    async def program() -> None:
        wire = Wire()
        grippers.append(wire.gripper)
        await activate_beforehand(wire.gripper)
        async with RobotiqHand(wire) as hand:
            hand.add_listener(end)
            await hand.move(255, speed=0)

    with pytest.raises(error), asyncio.Runner(loop_factory=VirtualLoop) as runner:
        runner.run(program())
    (gripper,) = grippers
    assert not Request.from_registers(gripper.request_registers).go
    assert not gripper.is_moving


async def test_a_move_whose_request_ends_the_program_in_a_listener_does_not_begin(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    """It was written although its call had raised."""

    def end(item: object) -> None:
        if isinstance(item, Transition) and item.target is State.RUNNING_CC:
            raise SystemExit

    hand.add_listener(end)
    writes = len(gripper.writes)
    with pytest.raises(SystemExit):
        await hand.move(255, A)
    for _ in range(5):
        await anext(hand.statuses())
    assert len(gripper.writes) == writes


async def coroutine(item: object) -> None:
    raise AssertionError("it would never be awaited")


@pytest.mark.parametrize("callback", [None, 3, coroutine], ids=["None", "3", "coroutine"])
def test_only_plain_functions_are_accepted(callback: Any) -> None:
    with pytest.raises(TypeError, match="callback must be a plain function"):
        RobotiqHand().add_listener(callback)


async def test_another_thread_is_refused_while_the_hand_runs(hand: RobotiqHand) -> None:
    with pytest.raises(RuntimeError, match="outside of the event loop"):
        await asyncio.to_thread(hand.add_listener, print)
