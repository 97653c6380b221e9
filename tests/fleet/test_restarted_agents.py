"""An agent that was started anew: what its clients asked for before counts, or nothing moves."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger
from robotiq_async.fleet.remote.requests import Settings
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.values.request import Request
from tests.fleet.world import World, world
from tests.virtual import virtual

A, ABC = Finger.A, Finger.ABC
GENTLE = (10, 5)


async def restart(here: World) -> None:
    """SIGKILL, and a new one; the holder has control again by itself."""
    hand = here.holder.hand
    here.kill(here.agent.host)
    await here.start_agent("agent again")
    await here.until(lambda: not hand.is_in_control)
    await here.until(lambda: hand.is_in_control)


def images(here: World, since: int) -> list[Request]:
    found = [Request.from_registers(write.registers) for write in here.gripper.writes[since:]]
    return [image for image in found if image.go]


@pytest.mark.parametrize("how", ["move", "set_position", "command", "many commands", "grasp"])
@virtual
async def test_speed_and_force_outlive_an_agent(how: str) -> None:
    """The next move went with speed 128 and force 64."""
    async with world() as here:
        hand = here.holder.hand

        async def set_up() -> None:
            await hand.set_speed(10)
            await hand.set_force(5)
            await hand.move(20, A)

        await here.holder.do(set_up())
        await restart(here)
        writes = len(here.gripper.writes)

        async def ask() -> None:
            if how == "move":
                await hand.move(40, A)
            elif how == "grasp":
                await hand.grasp(A, timeout=60)
            elif how == "set_position":
                await hand.set_position(40, A)
            else:
                for position in range(40, 41 if how == "command" else 60):
                    hand.command(A, position=position)
                    await asyncio.sleep(0.005)
                await asyncio.sleep(0.5)

        await here.holder.do(ask())
        found = images(here, writes)
        assert found
        for image in found:
            assert {(axis.speed, axis.force) for axis in image.axes} == {GENTLE}


@virtual
async def test_what_is_asked_for_anew_goes_before_what_was_asked_before() -> None:
    async with world() as here:
        hand = here.holder.hand

        async def set_up() -> None:
            await hand.set_speed(10)
            await hand.set_force(5)

        await here.holder.do(set_up())
        await restart(here)
        writes = len(here.gripper.writes)
        await here.holder.do(hand.move(40, A, speed=33))
        found = images(here, writes)
        assert (found[-1].axes[0].speed, found[-1].axes[0].force) == (33, 5)
        assert (found[-1].axes[1].speed, found[-1].axes[1].force) == GENTLE


def test_what_was_never_asked_for_is_not_given() -> None:
    settings = Settings()
    assert not settings.fields
    settings.note("cmd/move", Call("", "", number=2, arguments={"position": 9, "fingers": 1, "speed": 3}))
    assert settings.fields == {"1": {"speed": 3}}
    settings.note("cmd/set_force", Call("", "", number=4, arguments={"value": 7, "fingers": 7}))
    settings.note("cmd/set_force", Call("", "", number=3, arguments={"value": 200, "fingers": 3}))
    assert settings.fields == {"1": {"speed": 3, "force": 7}, "2": {"force": 7}, "4": {"force": 7}}
