"""Blocking programs in virtual time: the loop of the blocking hands jumps ahead while a program waits for it.

A program runs in its own thread, the loop in that of the hands. Time passes only while a call of the program
is being made, and :func:`rest` lets some pass between two. So a hundred thousand exchanges on a bad line take
no longer than their work, and two runs take the same course.
"""

from __future__ import annotations

import asyncio
import random
import selectors
import time
from collections.abc import Callable, Coroutine, Iterator
from contextlib import contextmanager
from typing import Any, TypeVar

import pytest

from robotiq_async import TWO_FINGER_85
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SerialSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    UrcapSimulatorServer,
)
from robotiq_async.simulator.troubles.corruption import ReplyPolicy
from robotiq_async.sync.loop_thread import LOOP_THREAD, _ThreadedCall
from tests.grippers import activate_beforehand
from tests.virtual import NothingWillHappenError, VirtualClock, VirtualLoop
from tests.virtual_line import VirtualLine

T = TypeVar("T")
LOOK_S = 1.0  # a virtual machine has been seen to lose a wake-up: the byte was there, and the loop slept on
WIRES = ("urcap", "tcp", "rtu+tcp", "rtu")
SERVERS = {"urcap": UrcapSimulatorServer, "tcp": SimulatorServer, "rtu+tcp": RtuOverTcpSimulatorServer}


class _Lockstep(VirtualClock):
    """Waits for the program when no call is being made, and moves the clock when one is."""

    def __init__(self) -> None:
        super().__init__()
        self.calls = 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout == 0:
            return []  # callbacks are due
        if not self.calls:
            return selectors.DefaultSelector.select(self, LOOK_S)
        if timeout is None:
            raise NothingWillHappenError("a call waits, and nothing is going to happen")
        self.now += timeout
        return []


class LockstepLoop(VirtualLoop):
    """The loop of the blocking hands."""

    def __init__(self) -> None:
        self._lockstep = _Lockstep()
        super().__init__(self._lockstep)

    def create_task(self, coro: Any, **options: Any) -> Any:
        task = super().create_task(coro, **options)
        if (
            getattr(coro, "__qualname__", "") == _ThreadedCall._run.__qualname__
        ):  # a call that the program waits for
            self._lockstep.calls += 1
            task.add_done_callback(self._made)
        return task

    def _made(self, _: object) -> None:
        self._lockstep.calls -= 1


@contextmanager
def in_virtual_time() -> Iterator[pytest.MonkeyPatch]:
    """Let blocking hands and the :func:`line` that they are at share virtual time.

    The clock and asyncio are below the code under test: the hands ask one for a loop, and programs the other.
    """
    loops: list[LockstepLoop] = []

    def new_loop() -> LockstepLoop:
        loops.append(LockstepLoop())
        return loops[-1]

    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(asyncio, "new_event_loop", new_loop)
        patch.setattr(time, "monotonic", lambda: loops[-1].time() if loops else 1e6)
        yield patch
    assert [complaint for loop in loops for complaint in loop.complaints] == []


def inside(function: Callable[[], Coroutine[Any, Any, T]]) -> T:
    """Make a call in the loop of the hands."""
    return LOOP_THREAD.call(function)


def rest(seconds: float) -> None:
    """Let time pass, as time.sleep() does for a program."""
    inside(lambda: asyncio.sleep(seconds))


class Line:
    """One simulated gripper on a wire, in the loop of the hands: a 2F-85 unless the options say otherwise.

    Attributes:
        gripper: the gripper.
        server: what puts it on the wire.
        address: where a hand finds it.
    """

    def __init__(self, wire: str, kind: type[SimulatedGripper] = SimulatedGripper, **options: Any) -> None:
        self._wire = wire
        self._kind = kind
        self._options = {"model": TWO_FINGER_85, "spread": False, **options}
        self._beside: list[asyncio.Task[None]] = []

    async def open(self, patch: pytest.MonkeyPatch, active: bool) -> None:
        self.gripper: Any = self._kind(asyncio.get_running_loop().time, **self._options)
        self.server: SimulatorServer | SerialSimulatorServer
        if self._wire == "rtu":
            cable = VirtualLine(patch)
            self.server = SerialSimulatorServer(cable.FAR, self.gripper)
            self.address = f"rtu://{cable.near}?model={self.gripper.model.name}"
            await self.server.start()
        else:
            self.server = SERVERS[self._wire](self.gripper)
            await self.server.start()
            self.address = self.server.address
        self._closing = asyncio.Event()
        self._keeping = asyncio.create_task(self._closing.wait(), name="the loop ends with its last task")
        if active:
            await activate_beforehand(self.gripper)

    async def begin(self, work: Callable[[], Coroutine[Any, Any, None]]) -> None:
        """Let something happen beside the program, until this is closed."""
        self._beside.append(asyncio.create_task(work()))

    async def close(self) -> None:
        for task in self._beside:
            task.cancel()
        await self.server.stop()
        self._closing.set()


@contextmanager
def line(wire: str, *, active: bool = True, **options: Any) -> Iterator[Line]:
    """A gripper on a wire, in virtual time."""
    with in_virtual_time() as patch:
        here = Line(wire, **options)
        inside(lambda: here.open(patch, active))
        try:
            yield here
        finally:
            inside(here.close)


def bad(share: float, late: float, seed: int = 1) -> ReplyPolicy:
    """A line that loses a share of the replies, or brings them so many seconds late: half of them each."""
    chance = random.Random(seed)

    def policy(frame: bytes) -> tuple[tuple[float, bytes], ...]:
        drawn = chance.random()
        if drawn >= share:
            return ((0.0, frame),)
        return () if drawn < share / 2 else ((late, frame),)

    return policy
