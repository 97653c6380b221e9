"""Whatever ends a call or a hand halfway stops the fingers: a cancelled task or scope, an error, stop()."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator

import anyio
import pytest
import pytest_asyncio

from robotiq_async import (
    Finger,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer
from tests.hand.watching import settled, until_moving

A, B, C = Finger.A, Finger.B, Finger.C


@pytest_asyncio.fixture
async def closing(hand: RobotiqHand, server: SimulatorServer) -> AsyncIterator[None]:
    """The gripper is on its way when the test begins."""
    await hand.set_speed(0)
    yield
    assert not server.gripper.is_moving
    assert all(server.gripper.position(axis) < 200 for axis in (A, B, C))


@pytest.mark.usefixtures("closing")
async def test_a_cancelled_task_stops_its_axes(hand: RobotiqHand, server: SimulatorServer) -> None:
    task = asyncio.create_task(hand.move(255))
    await until_moving(server, hand)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_asyncio_timeout_stops_the_axes(hand: RobotiqHand) -> None:
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.1):
            await hand.move(255)
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_an_anyio_scope_stops_the_axes(hand: RobotiqHand) -> None:
    with anyio.move_on_after(0.1) as scope:
        await hand.move(255)
    assert scope.cancelled_caught
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_leaving_through_an_exception_stops_the_fingers_short_of_their_target(
    server: SimulatorServer, hand: RobotiqHand
) -> None:
    await hand.stop()

    async def fail() -> None:
        async with RobotiqHand(server.address) as other:
            await other.set_position(255)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()


@pytest.mark.usefixtures("closing")
async def test_leaving_through_a_cancelled_scope_stops_the_fingers(
    server: SimulatorServer, hand: RobotiqHand
) -> None:
    await hand.stop()
    with anyio.CancelScope() as scope:
        async with RobotiqHand(server.address) as other:
            await other.set_position(255)
            scope.cancel()
            await asyncio.sleep(1)
    assert scope.cancelled_caught


async def test_a_cancelled_start_leaves_nothing_running(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start())
    transitions = hand.transitions()
    while (await anext(transitions)).target is not State.WF_ACTIVATION:
        pass
    await until_moving(server, hand)
    starting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await starting
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN


async def test_the_fingers_are_stopped_when_the_loop_is_torn_down(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.set_position(255)
    (poller,) = [task for task in asyncio.all_tasks() if task.get_name() == "robotiq_async poller"]
    poller.cancel()
    await asyncio.wait({poller})
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN


async def test_stop_ends_moves_with_not_started(hand: RobotiqHand) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    await hand.stop()
    with pytest.raises(NotStartedError):
        await moving


async def test_start_and_stop_from_different_tasks(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    await asyncio.create_task(hand.start(activate=False))
    await asyncio.gather(*(asyncio.create_task(hand.stop()) for _ in range(3)))
    assert hand.state is State.SHUTDOWN


async def test_stop_while_it_starts(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start())
    await asyncio.sleep(0)
    await hand.stop()
    with pytest.raises(NotStartedError):
        await starting
