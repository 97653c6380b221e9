"""The event loop is held up in each turn around a stop: do the fingers stop?

``python -m tests.adversity.blocks`` tries all of it in some minutes and prints what went wrong; the suite has
a part. The judge is the simulated gripper: what its axes do, and what it was written.
"""

from __future__ import annotations

import asyncio
import collections
import itertools
import logging
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Final

from robotiq_async import Finger, RobotiqError, State
from robotiq_async.values.events import Transition
from robotiq_async.values.request import Request
from tests.adversity.world import World, started
from tests.virtual import run

CALLS: Final = ("stop", "keep", "leave", "halt", "hold", "reset")
"""Ways to stop the fingers; "leave" is the end of ``async with``."""
BLOCKS_S: Final = (0.5, 1.0, 1.5, 3.0, 10.0)
MOMENTS_S: Final = (0.0, 0.0011, 0.0023, 0.0049)
"""In a cycle, at which the call is made."""
SETTLED_S: Final = 0.1  # a device cycle and some polls


@dataclass(frozen=True)
class Place:
    """The place of a block: as the caller of a move cleans up, in a listener, or in a turn of the loop.

    ``times`` blocks come, each ``turn`` turns after the last.
    """

    where: str
    turn: int = 0
    times: int = 1

    def __str__(self) -> str:
        return self.where if not self.turn else f"{self.where} {self.turn} x{self.times}"


PLACES: Final = (
    Place("clean-up"),
    Place("listener"),
    *(Place("turn", turn) for turn in range(1, 25)),
    *(Place("turn", turn, times=6) for turn in (1, 2, 3, 5)),
)


@dataclass(frozen=True)
class Case:
    call: str
    place: Place
    block: float
    moment: float


def all_cases() -> Iterator[Case]:
    for each in itertools.product(CALLS, PLACES, BLOCKS_S, MOMENTS_S):
        yield Case(*each)


async def called(here: World, call: str) -> None:
    match call:
        case "stop" | "keep":
            await here.hand.stop(keep_grip=call == "keep")
        case "leave":
            await here.hand.__aexit__(None, None, None)
        case _:
            await getattr(here.hand, call)()


async def life(case: Case) -> str:
    """Close slowly, and stop that while the loop is held up; what went wrong, or nothing."""
    async with started(speedup=1.0) as here:
        hand, loop, is_called = here.hand, here.loop, False

        async def work() -> None:
            try:
                await hand.close(speed=0)
            except RobotiqError:
                if case.place.where == "clean-up":
                    loop.hold_up(case.block)

        def hear(item: object) -> None:
            nonlocal is_called
            if is_called and isinstance(item, Transition):
                is_called = False
                loop.hold_up(case.block)

        def block(left: int) -> None:
            loop.hold_up(case.block)
            if left:
                loop.after_turns(case.place.turn, lambda: block(left - 1))

        working = asyncio.create_task(work())
        await asyncio.sleep(0.3 + case.moment)
        match case.place.where:
            case "listener":
                is_called = True
                hand.add_listener(hear)
            case "turn":
                loop.after_turns(case.place.turn, lambda: block(case.place.times - 1))
        await called(here, case.call)
        await working
        await asyncio.sleep(SETTLED_S)
        before = here.gripper.position(Finger.A)
        await asyncio.sleep(SETTLED_S)
        return wrong(here, case, closes=here.gripper.position(Finger.A) > before)


def wrong(here: World, case: Case, *, closes: bool) -> str:
    image = Request.from_registers(here.gripper.request_registers)
    # What is held is asked for where it was. A gripper in the same loop hears of it after the block, and
    # drives back.
    drives_back = case.call in ("hold", "keep") and not closes
    if closes or (here.gripper.is_moving and not drives_back):
        return "the fingers move"
    if image.go and case.call in ("stop", "leave", "halt"):
        return "rGTO is set"
    if image.activate and case.call == "reset":
        return "rACT is set"
    expected = {"halt": State.RUNNING_IDLE, "hold": State.RUNNING_IDLE, "reset": State.RESET}
    if here.hand.state is not expected.get(case.call, State.SHUTDOWN):
        return f"the state is {here.hand.state.name}"
    return ""


def main() -> None:
    logging.disable(logging.CRITICAL)
    results: collections.Counter[str] = collections.Counter()
    for case in all_cases():
        try:
            what = run(lambda case=case: life(case))  # type: ignore[misc]
        except Exception as error:  # noqa: BLE001  # one more result
            what = repr(error)
        results[what] += 1
        if what:
            print(f"{case.call}, {case.place}, {case.block} s at {case.moment * 1e3:.1f} ms: {what}")  # noqa: T201
    print(f"{results.total() - results['']} of {results.total()} went wrong")  # noqa: T201


if __name__ == "__main__":
    main()
