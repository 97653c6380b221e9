"""Replies to requests of connections that are gone: what happens when another client gets them."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Iterator

import pytest

from robotiq_async import ConnectionLostError, Finger, ProtocolError, RobotiqConnectionError, State
from robotiq_async.simulator import Trouble
from robotiq_async.values.request import AxisRequest, Request
from tests.adversity.world import World, started, world
from tests.simulator.test_server import raw_client
from tests.virtual import inside

A, BCS = Finger.A, (Finger.B, Finger.C, Finger.SCISSOR)
READ_STATUS = bytes.fromhex("04 0000 0008")


async def send(world: World, fingers: int, scissor: int) -> None:
    """Let another client send B, C and the scissor somewhere, and wait until they are there."""
    axes = tuple(AxisRequest(position, 255, 64) for position in (0, fingers, fingers, scissor))
    world.gripper.write(0, Request(activate=True, go=True, axes=axes).registers)
    await asyncio.sleep(10)


async def ask_and_go(world: World) -> None:
    """Request the status, first on a connection, and do not wait for the answer."""
    async with raw_client(world.server) as client:  # type: ignore[arg-type]
        client.writer.write(client.frame(READ_STATUS))
        heard = len(world.server.heard)
        await world.until(lambda: len(world.server.heard) > heard)


@contextlib.contextmanager
def no_other_axis_moves(world: World) -> Iterator[None]:
    before = world.travels()
    yield
    after = world.travels()
    assert {axis: after[axis] - before[axis] for axis in BCS} == dict.fromkeys(BCS, 0)


@inside(world)
async def test_a_left_over_reply_moves_no_axis_that_was_not_addressed(here: World) -> None:
    await here.activate_beforehand()
    await send(here, 99, 200)
    async with here.server.fault_injector.making(Trouble("multiplexer", 0.03)):
        await ask_and_go(here)
        await send(here, 40, 137)
        with no_other_axis_moves(here):
            with contextlib.suppress(RobotiqConnectionError):
                await here.hand.start(activate=False)
                await here.hand.set_position(60, A)
            await asyncio.sleep(5)
        here.check_no_stale_status()


@inside(world)
async def test_after_what_was_left_over_the_next_start_finds_the_gripper(here: World) -> None:
    await here.activate_beforehand()
    async with here.server.fault_injector.making(Trouble("multiplexer", 0.03)):
        await ask_and_go(here)
        await asyncio.sleep(0.1)
        with pytest.raises(ProtocolError, match="without a request"):
            await here.hand.start(activate=False)
        await here.hand.start(activate=False)
        with no_other_axis_moves(here):
            assert (await here.hand.move(60, A, speed=255)).positions[A] == pytest.approx(60, abs=2)
        here.check_no_stale_status()


@inside(started)
@pytest.mark.parametrize("late", [0.03, 0.2, 0.39])
async def test_a_hand_comes_back_through_a_multiplexer(here: World, late: float) -> None:
    """With a request before it knew of a reply left over, a connection would leave its own to the next."""
    async with here.server.fault_injector.making(Trouble("multiplexer", late)):
        await asyncio.sleep(1)
        for _ in range(5):
            await here.server.fault_injector.begin(Trouble("close"))
            await here.until_state(State.DISCONNECTED)
            await here.hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
            await asyncio.sleep(0.7)
        here.check_no_stale_status()


@inside(started)
@pytest.mark.parametrize("late", [0.46, 0.5, 0.55, 0.7])
async def test_no_status_is_older_than_a_reply_may_be(here: World, late: float) -> None:
    """Each reply comes to the connection after the one that sent the request, which has given up by then."""
    async with here.server.fault_injector.making(Trouble("multiplexer", late)):
        for position in range(20):
            with contextlib.suppress(RobotiqConnectionError):
                await here.hand.set_position(10 * position, A)
            await asyncio.sleep(1)
        here.check_no_stale_status()
        with pytest.raises(ConnectionLostError):
            await here.hand.set_position(0, A)
    await here.hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
    with no_other_axis_moves(here):
        await here.hand.move(60, A, speed=255)
    here.check_no_stale_status()
