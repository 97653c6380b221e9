"""Outcomes of a move whose lease ends on its way: the words that its caller hears, and the truth.

``python -m tests.fleet.outcomes``, in virtual time. For each trouble the position of finger A when the move
began and when all rests, the words of the call, and whether they are true: after "nothing was done" it stands
where it was, and after "it had begun" it does not.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Awaitable, Callable
from typing import Any, Final

from robotiq_async import Finger, RobotiqError
from tests.fleet.programs import say
from tests.fleet.world import World, world
from tests.virtual import virtual

FROZEN_S: Final = 3.0
REST_S: Final = 8.0  # for all to end: the lease, its hold, the client that returns
A: Final = Finger.A


async def freeze_client(here: World) -> None:
    here.freeze(here.holder.host)
    await asyncio.sleep(FROZEN_S)
    here.thaw(here.holder.host)


async def freeze_agent(here: World) -> None:
    here.freeze(here.agent.host)
    await asyncio.sleep(FROZEN_S)
    here.thaw(here.agent.host)


async def cut(here: World) -> None:
    here.cut(here.holder)
    await asyncio.sleep(FROZEN_S)
    here.mend(here.holder)


async def take(here: World) -> None:
    await here.other.do(here.other.hand.take())


async def halt(here: World) -> None:
    await here.other.do(here.other.hand.halt())


TROUBLES: Final[dict[str, Callable[[World], Awaitable[None]]]] = {
    "freeze of the client": freeze_client,
    "freeze of the agent": freeze_agent,
    "cut": cut,
    "take": take,
    "halt": halt,
}


def outcome(trouble: str, after: float) -> dict[str, Any]:
    """The story of a trouble that begins so many seconds after the call."""
    found: dict[str, Any] = {}

    @virtual
    async def run() -> None:
        async with world() as here:
            before, writes = here.gripper.position(A), len(here.gripper.writes)
            moving = here.holder.host.create_task(said(here.holder.hand.move(255, A, speed=0)))
            await asyncio.sleep(after)
            await TROUBLES[trouble](here)
            await here.until(moving.done)
            words = moving.result()
            await asyncio.sleep(REST_S)
            begun = len(here.gripper.writes) > writes and here.moved(A) > 1
            found.update(
                {
                    "trouble": trouble,
                    "after, s": after,
                    "from": before,
                    "to": here.gripper.position(A),
                    "said": words,
                    "true": "nothing was done" not in words if begun else "it had begun" not in words,
                }
            )

    run()
    return found


async def said(work: Awaitable[object]) -> str:
    try:
        await work
    except RobotiqError as error:
        return f"{type(error).__name__}: {error.message.rpartition('/')[2]}"
    return "done"


AFTER_S: Final = (0.0, 0.005, 0.5)
"""Seconds from the call to the trouble: before its request has left, on its way, and while it moves."""


if __name__ == "__main__":
    for name in TROUBLES:
        for seconds in AFTER_S:
            say(json.dumps(outcome(name, seconds)))
