"""Hands in a task group, side by side and when one of them dies: docs/how-to/many-hands.md."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable, Coroutine
from contextlib import AsyncExitStack
from typing import Any

import anyio
import pytest

from robotiq_async import ConnectionLostError, RobotiqError, RobotiqHand, State, Stream
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from tests.conftest import Clock

pytestmark = pytest.mark.virtual_time


Work = Callable[[], Coroutine[Any, Any, Any]]


async def with_asyncio(*works: Work) -> None:
    async with asyncio.TaskGroup() as group:
        for work in works:
            group.create_task(work())


async def with_anyio(*works: Work) -> None:
    async with anyio.create_task_group() as group:
        for work in works:
            group.start_soon(work)


Group = Callable[..., Awaitable[None]]
GROUPS = pytest.mark.parametrize("group", [with_asyncio, with_anyio])


class Cell:
    """Two grippers, and a hand on each."""

    def __init__(self, left: SimulatorServer, right: SimulatorServer) -> None:
        self.servers = left, right
        self.left = RobotiqHand(left.address, name="left")
        self.right = RobotiqHand(right.address, name="right", reconnect=False)

    async def pull_the_plug(self) -> None:
        """Pull the plug of the right one, once both move."""
        for hand in (self.left, self.right):
            async for status in hand.statuses():
                if status.is_moving:
                    break
        self.servers[1].cut()

    @property
    def last_write(self) -> Request:
        """The last write to the gripper of the left one."""
        return Request.from_registers(self.servers[0].gripper.writes[-1].registers)


@pytest.fixture
async def cell(clock: Clock) -> AsyncIterator[Cell]:
    async with AsyncExitStack() as stack:
        grippers = [SimulatedGripper(clock, speedup=20, spread=False) for _ in range(2)]
        yield Cell(*[await stack.enter_async_context(SimulatorServer(each)) for each in grippers])


def the_one(failed: BaseExceptionGroup[Any]) -> ConnectionLostError:
    (error,) = failed.exceptions
    assert isinstance(error, ConnectionLostError)
    return error


@GROUPS
async def test_around_the_group_the_other_is_held_and_goes_on(cell: Cell, group: Group) -> None:
    left, right = cell.left, cell.right
    async with left, right:
        with pytest.raises(BaseExceptionGroup) as caught:
            await group(lambda: left.close(speed=0), lambda: right.close(speed=0), cell.pull_the_plug)
        error = the_one(caught.value)
        assert (error.hand, str(error)) == ("right", f"right: {error.message}")
        assert left.state in (State.RUNNING_IDLE, State.RUNNING_CC)
        async for status in left.statuses():
            if left.state is State.RUNNING_IDLE and not left.is_moving:
                assert all(6 < status.position(axis) < 200 for axis in THREE_FINGER.axes[:3])
                break
        assert cell.last_write.go, "held, and not halted"
        await right.wait_for_state(State.SHUTDOWN)
        assert not cell.servers[1].gripper.is_moving, "it was reached once more"
        await left.open()
    assert not cell.last_write.go


@GROUPS
async def test_inside_its_task_the_other_is_stopped(cell: Cell, group: Group) -> None:
    async def work(hand: RobotiqHand) -> None:
        async with hand:
            await hand.close(speed=0)

    with pytest.raises(BaseExceptionGroup) as caught:
        await group(lambda: work(cell.left), lambda: work(cell.right), cell.pull_the_plug)
    assert the_one(caught.value).hand == "right"
    assert cell.left.state is State.SHUTDOWN
    assert not cell.last_write.go
    assert not cell.servers[0].gripper.is_moving


@GROUPS
async def test_an_error_caught_inside_its_task_leaves_the_others_alone(cell: Cell, group: Group) -> None:
    results: list[str] = []

    async def work(hand: RobotiqHand) -> None:
        try:
            async with hand:
                results.append(f"{hand.name}: {(await hand.close(speed=0)).positions[THREE_FINGER.axes[0]]}")
        except RobotiqError as error:
            results.append(error.hand)

    await group(lambda: work(cell.left), lambda: work(cell.right), cell.pull_the_plug)
    assert results == ["right", "left: 241"]


async def test_a_halt_of_all_reaches_those_that_can_be_reached(cell: Cell) -> None:
    hands = cell.left, cell.right
    async with cell.left, cell.right:
        cell.servers[1].cut()
        await cell.right.wait_for_state(State.SHUTDOWN)
        cell.left.command(position=255, speed=0)
        async for status in cell.left.statuses():
            if status.is_moving:
                break
        ended = await asyncio.gather(*(hand.halt() for hand in hands), return_exceptions=True)
        assert ended[0] is None
        assert isinstance(ended[1], ConnectionLostError)
        assert not cell.servers[0].gripper.is_moving


async def all_of(stream: Stream[Any]) -> None:
    async for _ in stream:
        pass


async def test_a_loop_that_reads_on_after_the_end_leaves_the_others_their_turns(cell: Cell) -> None:
    """Without a turn between two errors, no other hand polled any more, and no stop was sent."""
    async with cell.left, cell.right:
        stream = cell.right.statuses(lost_after=0.2)
        cell.servers[1].cut()
        await cell.right.wait_for_state(State.SHUTDOWN)
        turns: list[int] = []
        for number in range(3):
            asyncio.get_running_loop().call_soon(turns.append, number)
            with pytest.raises(ConnectionLostError):
                await all_of(stream)
            assert turns == list(range(number + 1))
