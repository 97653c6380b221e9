"""The force of a grip after a trouble is the same with a local hand and with a remote one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager, suppress
from dataclasses import dataclass

import pytest

from robotiq_async import Finger, MoveTimeoutError, RobotiqError, RobotiqHand, State
from robotiq_async.hands import Hand
from robotiq_async.values.request import Request
from tests.fleet.lab import POLL_S, Lab, lab
from tests.virtual import inside, until

A, B = Finger.A, Finger.B
RUNNING = (State.RUNNING_IDLE, State.RUNNING_CC)


@dataclass
class Side:
    """A hand on one side of the network, and how its way to the gripper is cut."""

    here: Lab
    hand: Hand
    cut: Callable[[], Awaitable[None]]
    mend: Callable[[], Awaitable[None]]

    def is_up(self) -> bool:
        return self.hand.state in RUNNING and getattr(self.hand, "is_in_control", True)

    async def lose_the_way(self) -> None:
        """For as long as the hand notices."""
        await self.cut()
        await until(lambda: not self.is_up())
        await self.mend()
        await until(self.is_up)

    @property
    def force(self) -> int:
        return Request.from_registers(self.here.gripper.request_registers).axes[0].force


@asynccontextmanager
async def side(kind: str) -> AsyncIterator[Side]:
    async with lab() as here:
        if kind == "remote":
            stream = here.network.stream("client", "agent")

            async def cut() -> None:
                here.network.cut(("client", "agent"))

            async def mend() -> None:
                here.network.mend(stream)

            async with here.client() as hand:
                yield Side(here, hand, cut, mend)
        else:
            await here.end_agent()
            async with RobotiqHand(here.server.address, poll_interval=POLL_S) as local:
                yield Side(here, local, here.server.stop, here.server.start)


async def timed_out(it: Side) -> int:
    with pytest.raises(MoveTimeoutError):
        await it.hand.move(140, A, speed=0, force=200, timeout=0.2)
    return 200


async def superseded(it: Side) -> int:
    moving = asyncio.create_task(it.hand.move(200, A, speed=0, force=200))
    await until(lambda: it.here.gripper.is_moving)
    await it.hand.set_position(20, A)
    await asyncio.gather(moving, return_exceptions=True)
    return 200


async def cancelled(it: Side) -> int:
    moving = asyncio.create_task(it.hand.move(200, A, speed=0, force=200))
    await until(lambda: it.here.gripper.is_moving)
    moving.cancel()
    await until(lambda: not it.here.gripper.is_moving)
    return 200


async def gripped(it: Side) -> int:
    it.here.gripper.place_object(A, 150)
    assert (await it.hand.close(A, force=200)).object_detected
    return 200


async def halted(it: Side) -> int:
    moving = asyncio.create_task(it.hand.move(200, A, speed=0, force=200))
    await until(lambda: it.here.gripper.is_moving)
    await it.hand.halt()
    await asyncio.gather(moving, return_exceptions=True)
    return 200


async def not_acknowledged(it: Side) -> int:
    """The gripper is away."""
    await it.here.server.stop()
    with pytest.raises(RobotiqError):
        await it.hand.set_force(200, A)
    await it.here.server.start()
    await until(it.is_up)
    return 10


async def refused(it: Side) -> int:
    with suppress(ValueError):
        await it.hand.move(140, A, force=256)
    return 10


STORIES: dict[str, Callable[[Side], Awaitable[int]]] = {
    each.__name__: each
    for each in (timed_out, superseded, cancelled, gripped, halted, not_acknowledged, refused)
}


@pytest.mark.parametrize("kind", ["local", "remote"])
@pytest.mark.parametrize("story", STORIES)
@inside(side, "kind")
async def test_the_force_of_a_grip(here: Side, kind: str, story: str) -> None:
    await here.hand.move(100, A, force=10)
    expected = await STORIES[story](here)
    await here.lose_the_way()
    forces = [here.force]
    await here.hand.set_speed(50, B)
    forces.append(here.force)
    await here.hand.set_position(60, A)
    assert [*forces, here.force] == [expected] * 3
