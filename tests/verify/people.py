"""Persons beside a simulated gripper, and runs with them."""

from __future__ import annotations

import asyncio
import contextlib
import threading
from collections.abc import AsyncIterator, Awaitable, Callable, Mapping
from typing import Any

from robotiq_async.link.address import parse_address
from robotiq_async.simulator import (
    RtuOverTcpSimulatorServer,
    SimulatedGripper,
    SimulatorServer,
    Trouble,
    UrcapSimulatorServer,
)
from robotiq_async.tools.verify import ENTER, CheckVerdict, Lengths, Plan, Report, Runner
from robotiq_async.tools.verify.catalogue import LAST, checks_of
from robotiq_async.tools.verify.recorded_link import RecordedExchange
from robotiq_async.tools.verify.stages import first_motions, loss, soft_part
from robotiq_async.values.enums import Finger
from tests.grippers import activate_beforehand

SHORT = Lengths(reads=20, idle=(0.5, 1.0, 1.5, 5.0), alone=(10.0,), soak=1.0, commands=0.5, interval=0.1)
FOAM = 120
"""The position at which the fingers meet it."""
WHICH = {Finger.A: "a", Finger.B: "l", Finger.C: "r", Finger.SCISSOR: "s"}


@contextlib.asynccontextmanager
async def threads() -> AsyncIterator[None]:
    """Let threads come to their end in a virtual loop, whose seconds would otherwise pass in a moment."""

    async def turn() -> None:
        while True:
            await asyncio.sleep(0.05)
            for thread in threading.enumerate():
                if thread.name == "robotiq_async":
                    thread.join(0.01)

    turning = asyncio.ensure_future(turn())
    try:
        yield
    finally:
        turning.cancel()


class Roll:
    """Takes frames, in memory."""

    failure = ""

    def __init__(self) -> None:
        self.frames: list[RecordedExchange] = []
        self.stages: list[int] = []

    def keep(self, frame: RecordedExchange) -> None:
        self.frames.append(frame)

    def begin(self, stage: int) -> None:
        self.stages.append(stage)

    def written(self) -> list[tuple[int, ...]]:
        return [frame.registers for frame in self.frames if frame.registers and frame.kind != "status"]


class Helper:
    """Agrees to everything, names the finger that really moved, and does the work by hand.

    Attributes:
        asked: the questions it got.
        alarms: what it was warned of.
        has_stopped: whether a key was pressed.
        before: is called with every question; what it returns, if anything, is the answer.
    """

    def __init__(self, server: SimulatorServer) -> None:
        self.asked: list[str] = []
        self.said: list[str] = []
        self.alarms: list[str] = []
        self.has_stopped = False
        self.before: Callable[[str], object] = lambda _: None
        self._server = server
        self._travel = dict.fromkeys(server.gripper.model.axes, 0.0)

    def tell(self, words: str) -> None:
        assert not self._server.gripper.is_moving, f"said while fingers move: {words}"
        self.said.append(words)

    def alarm(self, words: str) -> None:
        self.alarms.append(words)

    async def consents(self, words: str) -> bool:
        self._ask(words)
        answer = self.before(words)
        if answer is not None:
            return bool(answer)
        if words == soft_part.PLACE:
            self._server.gripper.place_object(Finger.ABC, FOAM)
        elif words == soft_part.RELEASE:
            self._server.gripper.remove_object(Finger.ABC)
        return True

    async def chooses(self, question: str, answers: Mapping[str, str]) -> str | None:
        assert answers
        gone = self._ask(question)
        answer = self.before(question)
        if isinstance(answer, str):
            return answer
        if question == soft_part.AGAIN:
            self._server.gripper.place_object(Finger.ABC, FOAM)
        if question == soft_part.HELD_QUESTION:
            return "y" if self._server.gripper.holds else "n"
        if question == loss.CABLE:
            await self._meanwhile(Trouble("refuse"))
        elif question == loss.ESTOP:
            await self._meanwhile(Trouble("e-stop"))
        elif question == loss.POWER:
            await self._meanwhile(Trouble("power-cut"))
        elif question in (first_motions.QUESTION, first_motions.JAW_QUESTION):
            return WHICH[max(gone, key=lambda axis: gone[axis])]
        return ENTER

    async def _meanwhile(self, trouble: Trouble) -> None:
        async with self._server.fault_injector.making(trouble):
            await asyncio.sleep(5)

    def _ask(self, question: str) -> dict[Finger, float]:
        """Note a question; how far each axis has gone since the one before."""
        self.asked.append(question)
        before = self._travel
        self._travel = {axis: self._server.gripper.travel(axis) for axis in before}
        return {axis: self._travel[axis] - before[axis] for axis in before}


@contextlib.asynccontextmanager
async def served(
    *troubles: str, active: bool = False, serial: bool = False, urcap: bool = False, **options: Any
) -> AsyncIterator[SimulatorServer]:
    """A gripper in the loop's time, with what goes wrong all the time.

    It is on TCP, on a paced serial line, or behind a URCap.
    """
    gripper = SimulatedGripper(asyncio.get_running_loop().time, **options)
    make = UrcapSimulatorServer if urcap else RtuOverTcpSimulatorServer if serial else SimulatorServer
    async with make(gripper) as server:
        if active:
            await activate_beforehand(gripper)
        for words in troubles:
            kind, _, value = words.partition(" ")
            await server.fault_injector.begin(Trouble(kind, float(value) if value else None))
        yield server


async def verified(
    server: SimulatorServer,
    helper: Helper | None = None,
    roll: Roll | None = None,
    *,
    save: Callable[[Report], Awaitable[None] | None] = lambda _: None,
    address: str = "",
    **plan: Any,
) -> Report:
    """A run to its end; at another address than that of the server if one is given."""
    wanted: dict[str, Any] = {"last": LAST, "lengths": SHORT} | plan
    there = parse_address(address or server.address)
    runner = Runner(Plan(there, **wanted), helper or Helper(server), roll or Roll(), save)
    async with asyncio.timeout(3600):
        return await runner.run()


def differing(report: Report) -> dict[str, dict[str, int | float]]:
    """The checks that differ, and the options that each names."""
    return {check.name: dict(check.options) for check in report.differing}


def assert_as_assumed(report: Report) -> None:
    """Every check of the stages that ran ended well."""
    assert report.why == "done", report.words
    wrong = {
        name: check for name, check in report.checks.items() if check.verdict is not CheckVerdict.AS_ASSUMED
    }
    assert not wrong
    expected = {
        name for name, each in checks_of(report.model, report.link).items() if each.stage in report.stages
    }
    assert report.checks.keys() == expected
