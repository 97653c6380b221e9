"""Phases of a hand in which something may go wrong: the way there, and the promises for it."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from typing import Any

from robotiq_async import Finger, State
from robotiq_async.values.enums import NO_AXES
from tests.adversity.world import World

A = Finger.A
TARGET = 200
SHORT = 14
"""A first move of some counts: where the object status is late, it ends before that has it."""

Call = Callable[[], Awaitable[Any]]


@dataclass(frozen=True)
class Phase:
    """One column of the table.

    Attributes:
        name: as in the table.
        reach: brings a world there and returns the call that is awaited then, if there is one.
        addressed: the axes that the call may move; those of the model.
        bound: seconds within which the call ends, whatever goes wrong.
        on_write: whether a trouble about replies is meant for the write of the call. Otherwise the poll
            before it would meet the trouble, and nothing would ever be written.
    """

    name: str
    reach: Callable[[World], Awaitable[Call | None]]
    addressed: Finger
    bound: float
    on_write: bool = False


async def connecting(world: World) -> Call:
    await world.activate_beforehand()
    return world.hand.start


async def activating(world: World) -> Call:
    await world.hand.start(activate=False)
    call = asyncio.create_task(world.hand.activate())
    await world.until_state(State.WF_ACTIVATION)
    await world.until_moving()
    return lambda: call


async def idle(world: World) -> None:
    await world.activate_beforehand()
    await world.hand.start()


async def command_pending(world: World) -> Call:
    await idle(world)
    return lambda: world.hand.set_position(TARGET, A)


async def moving(world: World) -> Call:
    await idle(world)
    await world.hand.move(SHORT, A)
    await world.until(lambda: not world.gripper.is_moving)  # a late status has it for longer
    call = asyncio.create_task(world.hand.move(TARGET, A, speed=0))
    await world.until_moving()
    return lambda: call


async def holding(world: World) -> None:
    world.gripper.place_object(Finger.ABC, 100)
    await idle(world)
    await world.hand.move(SHORT)
    result = await world.hand.close(speed=255)
    assert result.contacts == world.hand.model.mask(Finger.ABC)


async def resetting(world: World) -> Call:
    await idle(world)
    return world.hand.reset


async def releasing(world: World) -> Call:
    await idle(world)
    await world.hand.move(TARGET, speed=255)
    world.gripper.inject_fault(0x0E)  # major on each model
    await world.until_state(State.FAULT)
    call = asyncio.create_task(world.hand.atr())
    await world.until_state(State.WF_ATR)
    await world.until_moving()
    return lambda: call


async def stopping(world: World) -> Call:
    await idle(world)
    await world.hand.set_speed(0)
    await world.hand.set_position(TARGET, A)
    await world.until_moving()
    return world.hand.stop


async def keeping(world: World) -> Call:
    holds = world.holds
    world.gripper.place_object(holds, 100)
    await idle(world)
    result = await world.hand.close(holds, speed=255)
    assert result.contacts == holds
    if A not in holds:
        await world.hand.set_speed(0, A)
        await world.hand.set_position(TARGET, A)
        await world.until_moving()
    return lambda: world.hand.stop(keep_grip=True)


PHASES = (
    Phase("connecting", connecting, NO_AXES, 5.0),
    Phase("activating", activating, Finger.ALL, 25.0),
    Phase("idle", idle, NO_AXES, 0.0),
    Phase("command pending", command_pending, A, 1.0, on_write=True),
    Phase("moving", moving, A, 25.0),
    Phase("holding", holding, NO_AXES, 0.0),
    Phase("resetting", resetting, NO_AXES, 5.0, on_write=True),
    Phase("releasing", releasing, Finger.ALL, 65.0),
    Phase("stopping", stopping, A, 2.0, on_write=True),
    Phase("keeping a grip", keeping, A, 2.0, on_write=True),
)
