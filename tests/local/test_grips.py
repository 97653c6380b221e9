"""The fate of a grip: each row of the table in docs/what-happens-when.md, with keep_grip and without."""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import AsyncIterator, Awaitable, Callable
from contextlib import asynccontextmanager
from functools import partial

import pytest

from robotiq_async import Fault, Finger, RobotiqError, RobotiqHand, State
from robotiq_async.simulator import SimulatorServer
from tests.docs.pages import table

pytestmark = pytest.mark.virtual_time

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR
HELD = B | C
POLL_S = 0.02
"""The fate of a grip does not depend on how often the hand looks."""


def rows() -> dict[str, tuple[str, str]]:
    """The fate of the grip in each row as usual, and with keep_grip."""
    _, *rows = table("what-happens-when.md", "## A grip")
    return {what: (usual, kept) for what, usual, kept in rows}


class Bench:
    """A gripper, and programs that use it one after the other."""

    def __init__(self, server: SimulatorServer, *, keeps: bool) -> None:
        self.server = server
        self.gripper = server.gripper
        self.keeps = keeps

    @asynccontextmanager
    async def holding(self, poll_interval: float = POLL_S) -> AsyncIterator[RobotiqHand]:
        """The first program: B and C hold something."""
        address = self.server.address
        async with RobotiqHand(address, keep_grip=self.keeps, poll_interval=poll_interval) as hand:
            self.gripper.place_object(HELD, 150)
            await hand.close(HELD)
            assert self.gripper.grips == HELD
            yield hand

    async def moving(self, hand: RobotiqHand, fingers: Finger = A) -> asyncio.Task[object]:
        task: asyncio.Task[object] = asyncio.create_task(hand.close(fingers, speed=0))
        while not self.gripper.is_moving:  # noqa: ASYNC110  # there is no event to wait for
            await asyncio.sleep(0.001)
        return task

    @property
    def word(self) -> str:
        assert not self.gripper.is_moving
        if self.gripper.grips == HELD:
            return "grip"
        assert not self.gripper.grips
        return {HELD: "stays", Finger(0): "let go"}[self.gripper.holds]


# -- the rows ----------------------------------------------------------------------------------------------


async def left(here: Bench) -> str:
    async with here.holding():
        pass
    return here.word


async def left_while_another_moves(here: Bench) -> str:
    async with here.holding() as hand:
        moving = await here.moving(hand)
    at = here.gripper.position(A)
    assert isinstance((await asyncio.gather(moving, return_exceptions=True))[0], RobotiqError)
    await asyncio.sleep(1)
    assert abs(here.gripper.position(A) - at) <= 2
    assert at < 200
    return here.word


async def left_by_an_exception(here: Bench) -> str:
    with contextlib.suppress(ZeroDivisionError):
        async with here.holding():
            raise ZeroDivisionError
    return here.word


async def cancelled(here: Bench) -> str:
    async def program() -> None:
        async with here.holding() as hand:
            await hand.close(A, speed=0)

    task = asyncio.create_task(program())
    while here.gripper.grips != HELD or not here.gripper.is_moving:  # noqa: ASYNC110
        await asyncio.sleep(0.001)
    task.cancel()
    await asyncio.gather(task, return_exceptions=True)
    return here.word


async def killed(here: Bench) -> str:
    """Seen from the gripper: the connection ends, and no client comes back."""
    async with here.holding():
        here.server.refuse()
        here.server.cut()
        await asyncio.sleep(5)
        return here.word


async def link_lost_and_back(here: Bench) -> str:
    async with here.holding() as hand:
        writes = len(here.gripper.writes)
        here.server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
        await hand.wait_for_state(State.RUNNING_IDLE)
        await asyncio.sleep(1)
        assert len(here.gripper.writes) == writes
        return here.word


async def stopped_while_the_link_is_down(here: Bench) -> str:
    async with here.holding() as hand:
        here.server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
    return here.word


async def left_in_a_fault(here: Bench) -> str:
    async with here.holding() as hand:
        here.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        await hand.wait_for_state(State.FAULT)
    here.gripper.clear_faults()
    await asyncio.sleep(1)
    return here.word


async def another_is_moved(here: Bench) -> str:
    async with here.holding() as hand:
        await hand.move(100, A | S)
        return here.word


async def another_is_held(here: Bench) -> str:
    async with here.holding() as hand:
        moving = await here.moving(hand)
        moving.cancel()
        await asyncio.gather(moving, return_exceptions=True)
        await hand.hold()
        await asyncio.sleep(1)
        return here.word


async def held_while_it_presses_again(here: Bench) -> str:
    async with here.holding(0.001) as hand:
        for again in (hand.halt, partial(hand.set_force, 255)):
            await again()
            closing = asyncio.create_task(hand.close(HELD))
            async with asyncio.timeout(1.0):
                await anext(status async for status in hand.statuses() if HELD in status.moving)
            await hand.hold()
            await asyncio.gather(closing, return_exceptions=True)
            await asyncio.sleep(1)
            assert here.word == "grip"
        return here.word


async def halted(here: Bench) -> str:
    async with here.holding() as hand:
        await hand.halt()
        word = here.word
        await hand.move(100, A)
        assert here.word == "grip"
        await hand.halt()
    assert here.word == word
    return word


async def reset(here: Bench) -> str:
    async with here.holding() as hand:
        await hand.reset()
        return here.word


async def power_lost(here: Bench) -> str:
    async with here.holding():
        here.gripper.power_cycle()
        await asyncio.sleep(1)
        return here.word


async def next_connects(here: Bench) -> str:
    async with here.holding():
        pass
    hand = RobotiqHand(here.server.address, poll_interval=POLL_S)
    await hand.start()
    word = here.word
    await hand.stop(halt=False)
    assert here.word == word
    return word


async def next_moves_another(here: Bench) -> str:
    async with here.holding():
        pass
    async with RobotiqHand(here.server.address, poll_interval=POLL_S) as hand:
        await hand.move(100, A)
        asked = {hand.status.requested_position(axis) == 255 for axis in (B, C)}
        assert asked == {here.keeps}, "its own position, unless the echo is to be believed"
        return here.word


async def next_ends(here: Bench) -> str:
    async with here.holding():
        pass
    async with RobotiqHand(here.server.address, keep_grip=here.keeps, poll_interval=POLL_S):
        pass
    assert here.word == ("grip" if here.keeps else "stays"), "unless it keeps the grip as well"
    async with RobotiqHand(here.server.address, poll_interval=POLL_S):
        pass
    return here.word


PROBES: dict[str, Callable[[Bench], Awaitable[str]]] = {
    "`async with` is left": left,
    "it is left while another axis moves": left_while_another_moves,
    "it is left by an exception": left_by_an_exception,
    "the program is cancelled: Ctrl-C, SIGTERM with `stops_on_signals`": cancelled,
    "the process is killed, or crashes": killed,
    "the link is lost and comes back": link_lost_and_back,
    "`stop()` while the link is down": stopped_while_the_link_is_down,
    "it is left in a fault": left_in_a_fault,
    "another axis is moved": another_is_moved,
    "a move of another axis is cancelled, or `hold()`": another_is_held,
    "`hold()` while the finger presses again: after more force, or a command after `halt()`": (
        held_while_it_presses_again
    ),
    "`halt()`": halted,
    "`reset()`, `atr()`, `recover()` after a major fault": reset,
    "the power goes": power_lost,
    "the next program connects": next_connects,
    "the next program moves another axis": next_moves_another,
    "the next program ends, without its own `keep_grip=True`": next_ends,
}


@pytest.mark.parametrize("keeps", [False, True], ids=["as usual", "with keep_grip"])
@pytest.mark.parametrize("what", PROBES)
async def test_a_row(server: SimulatorServer, what: str, keeps: bool) -> None:
    assert await PROBES[what](Bench(server, keeps=keeps)) == rows()[what][keeps]


def test_every_row_is_tried() -> None:
    assert list(rows()) == list(PROBES)
