"""The watch of the soak run: it tells of a replay, and of nothing that only looks like one."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from contextlib import AsyncExitStack, asynccontextmanager

import pytest

from robotiq_async import JAW
from robotiq_async.simulator import Trouble
from robotiq_async.values.model import TWO_FINGER_85
from tests.adversity.watch import WriteWatch
from tests.adversity.world import UrcapServer, World, started
from tests.virtual import inside, until

FIRST, SECOND = "SPE 10 FOR 1 POS 100", "SPE 11 FOR 1 POS 200"


class Scene:
    """A jaw at a text port that is at the position of FIRST, and on its way to that of SECOND."""

    def __init__(self, world: World) -> None:
        self._world = world
        self._watch = WriteWatch(TWO_FINGER_85)

    async def say(self, asked: str) -> None:
        """Send a motion from a connection of its own, and wait until it is under way or over."""
        assert isinstance(self._world.server, UrcapServer)
        _, writer = await asyncio.open_connection("127.0.0.1", self._world.server.port)
        writer.write(f"SET {asked} GTO 1\n".encode())
        goal = int(asked.split()[-1])
        await until(lambda: abs(self._world.gripper.target(JAW) - goal) < 3)
        await asyncio.sleep(0.05)
        writer.close()

    def told(self) -> list[str]:
        return [*self._watch.check(self._world)]


@asynccontextmanager
async def on_the_way(spacing: float) -> AsyncIterator[Scene]:
    async with started("urcap", model=TWO_FINGER_85) as world, AsyncExitStack() as stack:
        await world.hand.stop(halt=False)
        scene = Scene(world)
        await scene.say(FIRST)
        await until(lambda: not world.gripper.is_moving)
        if spacing:
            trouble = Trouble("one-by-one", spacing)
            await stack.enter_async_context(world.server.fault_injector.making(trouble))
        await scene.say(SECOND)
        yield scene


@pytest.mark.parametrize("spacing", [0.0, 0.01])
@inside(on_the_way, "spacing")
async def test_a_command_that_comes_back_is_told(here: Scene) -> None:
    assert here.told() == []
    await here.say(FIRST)
    again, after = here.told()
    assert "asked again for what it was before: AxisRequest(position=100, speed=10, force=1)" in again
    assert after.startswith("after ")


@pytest.mark.parametrize("spacing", [0.0, 0.01])
@inside(on_the_way, "spacing")
async def test_a_hold_where_the_jaw_has_stood_is_no_replay(here: Scene) -> None:
    """Half of the command before it asked for the same, if its variables were taken one by one."""
    await here.say("SPE 11 FOR 1 POS 100")
    assert here.told() == []
