"""A gripper that loses its activation without requests for a while, as by one source."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import ConnectionLostError, Finger, NotActivatedError, State
from robotiq_async.simulator import Trouble
from robotiq_async.values.request import Request
from tests.adversity.world import World, started
from tests.virtual import inside

A, B = Finger.A, Finger.B
LINKS = ["tcp", "rtu"]


async def nothing_is_activated(world: World, since: int) -> None:
    """Neither at once nor later; on request the gripper is."""
    travels = world.travels()
    for ask in (lambda: world.hand.move(60, B), lambda: world.hand.set_position(60, B)):
        with pytest.raises(NotActivatedError):
            await ask()
    await asyncio.sleep(6)
    assert world.hand.state is State.RESET
    assert not any(Request.from_registers(write.registers).activate for write in world.gripper.writes[since:])
    assert world.travels() == travels
    await world.hand.recover()
    assert (await world.hand.move(60, B)).positions[B] == pytest.approx(60, abs=2)


@inside(started, "link", "monkeypatch")
@pytest.mark.parametrize("link", LINKS)
async def test_it_is_found_reset_when_the_link_is_back(here: World) -> None:
    moving = asyncio.create_task(here.hand.move(200, A, speed=0))
    await here.until_moving()
    writes = len(here.gripper.writes)
    async with here.server.fault_injector.making(Trouble("idle-reset", 0.5)):
        async with here.server.fault_injector.making(Trouble("silence")):
            with pytest.raises(ConnectionLostError):
                await moving
            await asyncio.sleep(1)
            assert not here.gripper.is_moving
        await here.until_state(State.RESET)
        await nothing_is_activated(here, writes)


@inside(started, "link", "monkeypatch")
@pytest.mark.parametrize("link", LINKS)
@pytest.mark.parametrize("command", [False, True])
async def test_it_loses_its_activation_while_the_loop_is_held_up(here: World, command: bool) -> None:
    moving = asyncio.create_task(here.hand.move(200, A, speed=0))
    await here.until_moving()
    writes = len(here.gripper.writes)
    async with here.server.fault_injector.making(Trouble("idle-reset", 0.5)):
        here.loop.hold_up(1.0)
        if command:
            here.hand.command(B, position=100)
        with pytest.raises(NotActivatedError):
            await moving
        await nothing_is_activated(here, writes)
    assert here.hand.statistics.reconnects == 0
