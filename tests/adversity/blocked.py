"""A hand in a process of its own is held up around a stop: do the fingers stop, and before the block?

A simulator in the same loop hides the order: a write that waits in the socket during the block counts as
written. So the hand runs in a forked process here, and the judge is the gripper of this one, by its true
motion. ``python -m tests.adversity.blocked`` tries all of it in some minutes and prints what went wrong; the
suite has a part.
"""

from __future__ import annotations

import asyncio
import contextlib
import itertools
import logging
import os
import signal
import sys
from asyncio.subprocess import PIPE, Process
from collections.abc import AsyncIterator, Iterable, Iterator
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass
from typing import Final

from robotiq_async import Finger, RobotiqError, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.service import stops_on_signals
from robotiq_async.values.events import Transition
from robotiq_async.values.request import Request
from tests.adversity.blocks import Case, Place
from tests.forked import CORE, ROOT, forking
from tests.grippers import active_gripper, shows, until
from tests.patience import patience

IMPORTED: Final = (*CORE, "robotiq_async.tools.service", "tests.adversity.blocks")
CALLS: Final = ("stop", "keep", "leave", "signal", "halt", "hold", "reset")
"""Ways to stop the fingers; "leave" is the end of ``async with``, "signal" a SIGTERM."""
PLACES: Final = (Place("clean-up"), Place("listener"), *(Place("turn", turn) for turn in range(9)))
BLOCKS_S: Final = (0.5, 1.5, 2.0, 5.0)
TOGETHER: Final = 12
"""Programs at a time, of the whole."""
SPEEDUP: Final = 0.25
"""A gripper that would close for half a minute: what stands was stopped."""
MOVES: Final = 9
"""A position that open fingers never have."""


def all_cases() -> Iterator[Case]:
    for call, place, block in itertools.product(CALLS, PLACES, BLOCKS_S):
        yield Case(call, place, block, 0.0)


# -- the program -------------------------------------------------------------------------------------------


def say(word: str) -> None:
    """Say it and do nothing, in no turn of the loop, until the judge answers."""
    print(word, flush=True)  # noqa: T201
    sys.stdin.readline()


class Program:
    """Close slowly, and stop that while the loop is held up. The judge decides for how long."""

    def __init__(self, address: str, call: str, where: str, turn: int) -> None:
        self._hand = RobotiqHand(address, response_timeout=2.0)  # on a busy machine
        self._call = call
        self._where = where
        self._turn = turn
        self._has_begun = False

    async def run(self) -> None:
        say("ready")
        if self._call == "signal":
            async with stops_on_signals(self._hand):
                await self._stop()
                await asyncio.sleep(60)
        elif self._call == "leave":
            async with self._hand:
                await self._stop()
        else:
            await self._stop()
        say(self._hand.state.name)

    async def _stop(self) -> None:
        if self._call != "leave":
            await self._hand.start()
        working = asyncio.create_task(self._work())
        await shows(self._hand, lambda status: status.position(Finger.A) > MOVES)
        self._hand.add_listener(self._hear)
        self._has_begun = True
        if self._where == "turn":
            self._block_after(self._turn)
        match self._call:
            case "leave":
                return
            case "signal":
                os.kill(os.getpid(), signal.SIGTERM)
            case "stop" | "keep":
                await self._hand.stop(keep_grip=self._call == "keep")
            case _:
                await getattr(self._hand, self._call)()
        await working
        if self._call in ("halt", "hold"):
            await self._hand.wait_for_state(State.RUNNING_IDLE, timeout=5.0)

    async def _work(self) -> None:
        try:
            await self._hand.close(speed=0)
        except RobotiqError:
            if self._where == "clean-up":
                say("blocked")

    def _hear(self, item: object) -> None:
        if self._where == "listener" and self._has_begun and isinstance(item, Transition):
            self._has_begun = False
            say("blocked")

    def _block_after(self, turns: int) -> None:
        loop = asyncio.get_running_loop()
        if turns:
            loop.call_soon(self._block_after, turns - 1)
        else:
            loop.call_soon(say, "blocked")


# -- the judge ---------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Life:
    """A program, and the gripper that judges it."""

    case: Case
    gripper: SimulatedGripper
    program: Process

    async def said(self) -> str:
        assert self.program.stdout is not None
        return (await self.program.stdout.readline()).decode().strip()

    def answer(self) -> None:
        assert self.program.stdin is not None
        self.program.stdin.write(b"\n")

    async def has_stopped(self, within: float) -> bool:
        with contextlib.suppress(TimeoutError):
            await until(lambda: not self.gripper.is_moving, within)
        return not self.gripper.is_moving

    async def judged(self) -> str:
        """Let the program run; what went wrong, or nothing."""
        self.answer()
        said, where = await self.said(), self.case.place.where
        if said == "blocked":
            if where in ("clean-up", "listener") and not await self.has_stopped(within=5.0):
                return "the fingers move while the program is held up"
            await asyncio.sleep(self.case.block)
            self.answer()
            said = await self.said()
        elif where != "turn":
            return f"it was not held up, and said {said!r}"
        has_stopped = await self.has_stopped(within=1.0)
        image = Request.from_registers(self.gripper.request_registers)
        if not has_stopped:
            return "the fingers move"
        if image.go and self.case.call in ("stop", "leave", "signal", "halt"):
            return "rGTO is set"
        if image.activate and self.case.call == "reset":
            return "rACT is set"
        expected = {"halt": State.RUNNING_IDLE, "hold": State.RUNNING_IDLE, "reset": State.RESET}
        if said != expected.get(self.case.call, State.SHUTDOWN).name:
            return f"the state is {said}"
        return ""


@asynccontextmanager
async def begun(case: Case) -> AsyncIterator[Life]:
    """A program that waits until it is judged."""
    gripper = active_gripper(SPEEDUP, spread=False)
    async with SimulatorServer(gripper) as server:
        with forking(IMPORTED):
            program = await asyncio.create_subprocess_exec(
                *(sys.executable, "-m", "tests.adversity.blocked", server.address),
                *(case.call, case.place.where, str(case.place.turn)),
                cwd=ROOT,
                env=os.environ,
                stdin=PIPE,
                stdout=PIPE,
            )
        here = Life(case, gripper, program)
        try:
            assert await here.said() == "ready"
            yield here
        finally:
            with contextlib.suppress(ProcessLookupError):
                program.kill()
            await program.wait()
            program._transport.close()  # type: ignore[attr-defined]


async def judge(cases: Iterable[Case]) -> dict[Case, str]:
    """Run a program for each, all at a time; what went wrong in which."""
    async with AsyncExitStack() as stack, asyncio.timeout(patience(60)):
        # A program that is forked holds up the grippers of the others: they begin together.
        lives = [await stack.enter_async_context(begun(case)) for case in cases]
        results = await asyncio.gather(*(each.judged() for each in lives))
    return {each.case: what for each, what in zip(lives, results, strict=True) if what}


async def main() -> None:
    cases, failed = list(all_cases()), 0
    for begin in range(0, len(cases), TOGETHER):
        results = await judge(cases[begin : begin + TOGETHER])
        failed += len(results)
        for case, what in results.items():
            print(f"{case.call}, {case.place}, {case.block} s: {what}")  # noqa: T201
    print(f"{failed} of {len(cases)} went wrong")  # noqa: T201


if __name__ == "__main__":
    logging.disable(logging.CRITICAL)
    match sys.argv[1:]:
        case [address, call, where, turn]:
            asyncio.run(Program(address, call, where, int(turn)).run())
        case _:
            asyncio.run(main())
