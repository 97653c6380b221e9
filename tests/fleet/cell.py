"""One cell of the table: one trouble during one thing that the holder does, and all that is promised."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Coroutine
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

from robotiq_async import Finger, RobotiqConnectionError, RobotiqError, State
from robotiq_async.values.errors import ControlLostError
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from tests.fleet.troubles import Trouble
from tests.fleet.world import PROMPT_S, WINDOW_S, World, motions

TARGET = 130
RATE_S = 0.01
SETTLE_S = 2.5
"""After the trouble: so long everything has to come right by itself, and nothing may come late."""


@dataclass
class Doing:
    """What the holder does.

    Attributes:
        asked: what a control loop asked for, and when.
        call: ends when the call or the loop of the holder does; None if there is none.
    """

    world: World
    asked: dict[tuple[int, int], float] = field(default_factory=dict)
    call: asyncio.Task[str] | None = None
    writes: int = 0
    goes_on: bool = True

    def begin(self, work: Coroutine[Any, Any, Any]) -> None:
        self.call = self.world.holder.host.start(told(work))

    async def loop(self) -> None:
        """A control loop: each of its commands is told from all others by position and speed."""
        hand, world = self.world.holder.hand, self.world
        number = 0
        while self.goes_on:
            value = (TARGET + number % 100, number // 100)
            self.asked[value] = world.now()
            hand.command(Finger.A, position=value[0], speed=value[1])
            number += 1
            await asyncio.sleep(RATE_S)


async def idle(_doing: Doing) -> None:
    pass


async def moving(doing: Doing) -> None:
    doing.begin(doing.world.holder.hand.move(TARGET, Finger.A, speed=0))
    await doing.world.until(lambda: doing.world.gripper.position(Finger.A) > 10)


async def looping(doing: Doing) -> None:
    doing.begin(doing.loop())
    await doing.world.until(lambda: doing.world.gripper.position(Finger.A) > 10)


async def gripping(doing: Doing) -> None:
    doing.world.gripper.place_object(Finger.ABC, 60)
    await doing.world.holder.do(doing.world.holder.hand.close(Finger.ABC, speed=255))
    await asyncio.sleep(0.3)


PHASES: dict[str, Callable[[Doing], Coroutine[Any, Any, None]]] = {
    "idle": idle,
    "a slow move": moving,
    "a control loop": looping,
    "holding a grip": gripping,
}


@dataclass(frozen=True)
class Outcome:
    """What came of it.

    Attributes:
        words: as in the table.
        held_after: seconds from the beginning of the trouble until nothing moved; None if it moved on.
    """

    words: str
    held_after: float | None


async def outcome(world: World, phase: str, trouble: Trouble) -> Outcome:
    """Let it happen.

    Raises:
        AssertionError: a promise was broken.
    """
    doing = Doing(world)
    await PHASES[phase](doing)
    holder, gripper = world.holder, world.gripper
    holder.states.clear()
    holder.had_control.clear()
    await world.settle()
    request = gripper.request_registers
    doing.writes = len(gripper.writes)
    began = world.now()
    resting = asyncio.ensure_future(rest(world))
    await trouble(world)
    await asyncio.sleep(SETTLE_S)
    what = await said(doing)
    fingers, held = await _fingers(doing, resting, began)
    if phase == "holding a grip":
        asked, before = (
            [(axis.position, axis.force) for axis in Request.from_registers(registers).axes]
            for registers in (gripper.request_registers, request)
        )
        assert asked == before, f"the grip was relaxed: {asked}"
        check_travel(world, Finger(0))
        fingers = "grips"
    elif phase == "idle":
        fingers = "at rest"
    check_commands(doing)
    check_travel(world, Finger.A)
    lease = lease_of(world)
    await works(world)
    world.check()
    words = ", ".join(each for each in (what, fingers, lease) if each)
    return Outcome(words, held)


async def said(doing: Doing) -> str:
    """What the holder was told: how its call ended, else what its hand showed."""
    holder, call = doing.world.holder, doing.call
    if holder.host.is_dead:
        return "killed"
    if call is not None and not call.done() and doing.asked:
        doing.goes_on = False
        await doing.world.until(call.done)
    if call is not None:
        await doing.world.until(call.done, 20)
        return call.result()
    if State.DISCONNECTED in holder.states:
        return "silence"
    return "lease lost" if False in holder.had_control else "nothing"


async def rest(world: World) -> float:
    """When the fingers last moved."""
    since = world.now()
    while True:
        await asyncio.sleep(0.005)
        if world.gripper.is_moving:
            since = world.now()
        elif world.now() - since > 1.0:
            return since


async def _fingers(doing: Doing, resting: asyncio.Task[float], began: float) -> tuple[str, float | None]:
    """Where they came to rest, and after what time."""
    world = doing.world
    async with asyncio.timeout(20):
        stood = await resting
    position = world.gripper.position(Finger.A)
    if doing.call is not None and position >= TARGET - 2:
        return "there", None
    return "held", stood - began


def check_commands(doing: Doing) -> None:
    """Nothing of a control loop was carried out twice, out of turn, or later than a window after that."""
    done = commands(doing)
    order = list(doing.asked)
    numbers = [order.index(what) for _, what in done]
    assert all(one < other for one, other in pairwise(numbers)), "carried out twice, or out of turn"
    late = [(at - doing.asked[what]) for at, what in done]
    assert all(each <= WINDOW_S + PROMPT_S for each in late), f"carried out late: {max(late):.2f} s"


def commands(doing: Doing) -> list[tuple[float, tuple[int, int]]]:
    """Which of its commands reached the gripper, and when."""
    found: list[tuple[float, tuple[int, int]]] = []
    for at, what in motions(doing.world, doing.writes):
        if what in doing.asked and (not found or found[-1][1] != what):
            found.append((at, what))
    return found


def check_travel(world: World, addressed: Finger) -> None:
    moved = {axis: world.moved(axis) for axis in THREE_FINGER.axes if axis not in addressed}
    assert not any(moved.values()), f"axes moved that nobody addressed: {moved}"


def lease_of(world: World) -> str:
    """Whose the lease is now, and whether the holder noticed."""
    holder = world.holder
    if holder.host.is_dead:
        return "lease ended"
    if not holder.hand.is_in_control:
        return "lease lost"
    return "lease back" if False in holder.had_control else "lease kept"


async def told(work: Coroutine[Any, Any, Any]) -> str:
    """How a call ends, in the words of the table."""
    try:
        await work
    except ControlLostError as error:
        return f"ControlLost {error.reason}"
    except RobotiqConnectionError as error:
        kinds = [kind.__name__ for kind in type(error).__mro__]
        return "ConnectionLost" if "ConnectionLostError" in kinds else kinds[0].removesuffix("Error")
    except RobotiqError as error:
        return type(error).__name__.removesuffix("Error")
    return "done"


async def works(world: World) -> None:
    """The halt of anybody is heard and does what it says; then the hand is as good as new."""
    holder, other = world.holder, world.other
    at = world.now()
    heard = await other.do(told(other.hand.halt()))
    assert heard == "done", heard
    assert world.now() - at < 1.0
    assert not world.gripper.is_moving
    commander = holder
    if holder.host.is_dead:
        commander = other
    else:
        # Who lost the lease to somebody's halt does not come back by itself.
        await asyncio.sleep(1.5)
        assert not holder.hand.is_in_control, "the old holder came back after a halt"
    await commander.do(commander.hand.acquire())
    await world.settle()
    result = await commander.do(commander.hand.move(40, Finger.B, speed=255))
    assert abs(result.positions[Finger.B] - 40) <= 2
    check_travel(world, Finger.B)
