"""Two calls at once: the second comes in every seventh turn of the loop while the first runs.

The turns between are those of the six calls before it in the table: something comes in each turn of a call.
"""

from __future__ import annotations

import asyncio
import logging
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqError, State
from tests.adversity.test_cancellation import active, check_nothing_is_left, in_fault, rest
from tests.adversity.test_cancellation import reset as in_reset
from tests.adversity.world import World, world
from tests.virtual import run

A, B = Finger.A, Finger.B
FAST = 2000.0
"""The gripper does everything within a poll or two: all there is to walk through is what the hand does."""
MOST_TURNS = 60
STEP = 7
POLL_S = 0.06
"""The steps are turns of the loop, of which a poll has as many however often it comes."""

Call = Callable[[World], Awaitable[Any]]
CALLS: dict[str, Call] = {
    "set_position": lambda world: world.hand.set_position(120, A),
    "set_force": lambda world: world.hand.set_force(9, A),
    "move": lambda world: world.hand.move(100, A | B),
    "hold": lambda world: world.hand.hold(A),
    "halt": lambda world: world.hand.halt(),
    "reset": lambda world: world.hand.reset(),
    "activate": lambda world: world.hand.activate(),
    "atr": lambda world: world.hand.atr(),
    "recover": lambda world: world.hand.recover(),
    "stop": lambda world: world.hand.stop(),
}
READY: dict[str, tuple[Callable[[World], Awaitable[None]], tuple[str, ...]]] = {
    "active": (active, ("set_position", "set_force", "move", "hold", "halt", "reset", "stop")),
    "reset": (in_reset, ("activate", "recover", "reset", "stop")),
    "fault": (in_fault, ("halt", "atr", "reset", "recover", "stop")),
}


@pytest.mark.parametrize(
    ("ready", "first"), [(ready, call) for ready, (_, calls) in READY.items() for call in calls]
)
def test_a_second_call_in_every_seventh_turn(
    ready: str, first: str, caplog: pytest.LogCaptureFixture
) -> None:
    caplog.set_level(logging.CRITICAL, logger="robotiq_async")
    for number, second in enumerate(CALLS):
        first_turn = 2 + number % STEP
        for turn in range(first_turn, MOST_TURNS, STEP):
            try:
                if not run(lambda: collide(ready, first, second, turn)):  # noqa: B023  # run at once
                    break
            except BaseException as error:
                error.add_note(f"{second} in turn {turn}")
                raise
        # What has nothing to write ends in a few turns.
        is_short = (ready, first) in (("reset", "stop"), ("active", "hold"))
        assert turn > first_turn or is_short, f"the first call was over at once, before {second}"
        assert not caplog.records, f"the task that owns the link failed: {second}"


async def collide(ready: str, first: str, second: str, turn: int) -> bool:
    """Make both calls and look at what is left; False if the first was over before the second came."""
    async with world(speedup=FAST, poll_interval=POLL_S) as here:
        await READY[ready][0](here)
        one = asyncio.create_task(ending(CALLS[first](here)))
        others: list[asyncio.Task[str]] = []

        def call() -> None:
            if not one.done():
                others.append(asyncio.create_task(ending(CALLS[second](here))))

        here.loop.after_turns(turn, call)
        async with asyncio.timeout(10):
            await one
            await asyncio.gather(*others)
        if not others:
            return False
        await rest(here)
        if here.hand.state is not State.DISCONNECTED:
            await check_nothing_is_left(here)
        return True


async def ending(call: Awaitable[Any]) -> str:
    """The outcome of a call; anything but a result or an error of the contract fails the test."""
    try:
        await call
    except RobotiqError as error:
        return type(error).__name__
    return "done"
