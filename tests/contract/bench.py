"""One gripper, and a hand on it: of this process, or on another host. Everything in one virtual loop."""

from __future__ import annotations

import asyncio
import functools
from collections.abc import AsyncIterator, Callable, Coroutine, Mapping
from contextlib import asynccontextmanager
from contextvars import ContextVar
from dataclasses import dataclass
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.hand import Hand
from robotiq_async.simulator import SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.values.model import THREE_FINGER, Model
from robotiq_async.values.request import Request
from tests.fleet.lab import SPEEDUP, Lab, lab
from tests.grippers import activate_beforehand
from tests.virtual import virtual

LOCAL, REMOTE = "local", "remote"
A, B, C, S = THREE_FINGER.axes
HABIT: ContextVar[tuple[Trouble | None, Mapping[str, Any]]] = ContextVar("habit", default=(None, {}))
"""What is otherwise with the gripper of a hand of this process, and the options of that hand."""
MODEL: ContextVar[Model] = ContextVar("model", default=THREE_FINGER)
"""What the gripper is."""
LIMIT_S = 500.0
"""Of virtual time: what takes longer hangs."""


@dataclass
class Bench:
    """What a test of the contract needs.

    Attributes:
        make: a hand that is not started; each call makes another one on the same gripper.
        lab: what stands behind a hand on another host; None for a hand of this process.
    """

    gripper: SimulatedGripper
    server: SimulatorServer
    make: Callable[[], Hand]
    lab: Lab | None = None

    @property
    def writes(self) -> int:
        return len(self.gripper.writes)

    @property
    def last_write(self) -> Request:
        return Request.from_registers(self.gripper.writes[-1].registers, self.gripper.model)

    @property
    def travels(self) -> list[float]:
        return [self.gripper.travel(axis) for axis in self.gripper.model.axes]

    async def moves(self) -> None:
        """Wait until the gripper moves."""
        await until(lambda: self.gripper.is_moving)


@asynccontextmanager
async def bench(where: str, *, active: bool = True) -> AsyncIterator[Bench]:
    """A gripper that is active, or reset, and a way to make hands on it."""
    if where == REMOTE:
        async with lab(active=active, model=MODEL.get()) as here:
            await connected(here)
            names = iter(range(1000))
            yield Bench(here.gripper, here.server, lambda: here.client(f"client {next(names)}"), here)
        return
    loop = asyncio.get_running_loop()
    cycle, model = 0.005 * SPEEDUP, MODEL.get()
    gripper = SimulatedGripper(loop.time, speedup=SPEEDUP, device_cycle=cycle, spread=False, model=model)
    async with SimulatorServer(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        habit, options = HABIT.get()
        if habit is not None:
            await server.fault_injector.begin(habit)
        yield Bench(gripper, server, lambda: RobotiqHand(server.address, model=gripper.model, **options))


async def connected(here: Lab) -> None:
    """Wait until the agent has its gripper."""
    await until(lambda: here.local.state not in (State.DISCONNECTED, State.SHUTDOWN))


async def until(condition: Callable[[], bool]) -> None:
    """Look at every virtual millisecond: a gripper sends no events."""
    loop = asyncio.get_running_loop()
    while not condition():
        turn = loop.create_future()
        loop.call_later(0.001, turn.set_result, None)
        await turn


def contract(test: Callable[..., Coroutine[Any, Any, None]]) -> Callable[..., None]:
    """Let a coroutine function be a test of both hands; ``where`` says of which."""

    @functools.wraps(test)
    async def within_limits(**arguments: Any) -> None:
        async with asyncio.timeout(LIMIT_S):
            await test(**arguments)

    both: Callable[..., None] = pytest.mark.parametrize("where", [LOCAL, REMOTE])(virtual(within_limits))
    return both


async def at_rest(hand: Hand) -> None:
    """Wait until nothing moves."""
    async for _ in hand.statuses():
        if hand.state is State.RUNNING_IDLE and not hand.is_moving:
            return


async def statuses(hand: Hand, count: int) -> list[int]:
    """The sequences of so many statuses."""
    stream = hand.statuses(buffer=1000)
    return [(await anext(stream)).sequence for _ in range(count)]


async def ended(task: asyncio.Task[Any]) -> BaseException | None:
    """How a task ends."""
    await asyncio.wait({task})
    return asyncio.CancelledError() if task.cancelled() else task.exception()


__all__ = [
    "LOCAL",
    "REMOTE",
    "A",
    "B",
    "Bench",
    "C",
    "Finger",
    "S",
    "at_rest",
    "bench",
    "contract",
    "ended",
    "statuses",
    "until",
]
