"""Fingers that nobody commands any more are held: a client is gone, or calls its command off.

A project and a number in a docstring: the issue in which it went wrong with that project's robots.
"""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import Finger, RobotiqError, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.fleet.wire.envelope import Answer
from robotiq_async.values.errors import AgentError
from tests.fleet.by_hand import move_slowly
from tests.fleet.lab import lab
from tests.fleet.spoiling import Spoiling
from tests.fleet.world import world
from tests.virtual import virtual


async def cut_off(hand: RemoteHand) -> None:
    """Begin a slow move, and cancel it on its way."""
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.3):
            await hand.move(255, Finger.A, speed=0)


@virtual
async def test_the_client_is_killed_while_it_moves() -> None:
    """doosan-robot2 247: the arm went on."""
    async with world() as here:
        await move_slowly(here)
        killed = here.now()
        here.kill(here.holder.host)
        await here.until(lambda: not here.gripper.is_moving)
        assert here.now() - killed <= 1.2


@virtual
async def test_what_moves_is_held_as_soon_as_the_gripper_is_reached_again() -> None:
    """The lease ends while the agent has lost its gripper, which goes on to its target."""
    async with world() as here:
        await move_slowly(here)
        await here.servers["left"].stop()
        await here.until(lambda: here.other.hand.state is State.DISCONNECTED)
        here.kill(here.holder.host)
        await asyncio.sleep(1.5)
        assert here.gripper.is_moving
        await here.servers["left"].start()
        await here.until(lambda: here.other.hand.state is State.RUNNING_IDLE)
        await asyncio.sleep(0.2)
        assert not here.gripper.is_moving


@virtual
async def test_a_refused_command_does_not_forget_the_hold_that_is_owed() -> None:
    """It was forgotten before the command was known to be carried out, and a dead holder's fingers ran on."""
    async with lab() as here:
        gone, other = here.client("gone"), here.client("other", control=False)
        await gone.start()
        await other.start()
        moving = asyncio.create_task(gone.move(255, Finger.ABC, speed=0))
        while not here.gripper.is_moving:  # noqa: ASYNC110  # what is waited for tells nobody
            await asyncio.sleep(0.001)
        await here.server.stop()
        here.network.cut(("gone", "agent"), ("agent", "gone"))
        await asyncio.sleep(1.2)
        await other.acquire()
        with pytest.raises(RobotiqError):
            await other.set_speed(10)
        await here.server.start()
        await asyncio.sleep(1.0)
        assert not here.gripper.is_moving
        await asyncio.gather(moving, return_exceptions=True)
        await other.stop()
        await gone.stop()


@virtual
@pytest.mark.parametrize("lost", [1, 1_000_000])
async def test_a_cancelled_move_is_called_off_although_that_was_lost(lost: int) -> None:
    """It was asked once, and the fingers ran on under a lease that was renewed."""
    async with lab() as here:
        bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=lost)
        async with here.client_over(bus) as hand:
            await cut_off(hand)
            await asyncio.sleep(2.5)
            assert not here.gripper.is_moving
            assert here.gripper.position(Finger.A) < 220


@virtual
async def test_a_cancelled_move_is_called_off_although_that_was_misrouted() -> None:
    """Any refusal counted as the end of the lease, and the fingers ran on under one that was renewed."""
    async with lab() as here:
        answer = Answer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
        bus = Spoiling(here.network.bus("client"), "cmd/cancel", times=1, answer=answer, is_sent=False)
        async with here.client_over(bus) as hand:
            await cut_off(hand)
            await asyncio.sleep(0.2)
            assert not here.gripper.is_moving
            assert hand.is_in_control


@virtual
async def test_a_move_whose_answer_was_anothers_is_called_off() -> None:
    async with lab() as here:
        answer = Answer("robotiq/v1/lab/cell/right", 3, 1, {}).pack()
        async with here.client_over(Spoiling(here.network.bus("client"), "cmd/move", answer=answer)) as hand:
            with pytest.raises(AgentError, match="another answer"):
                await hand.move(255, Finger.A, speed=0)
            await asyncio.sleep(0.5)
            assert not here.gripper.is_moving
