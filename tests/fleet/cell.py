"""One cell of the table of docs/fleet-under-fault.md: a trouble during one thing that the holder does."""

from __future__ import annotations

import asyncio
import random
import re
from collections.abc import Callable, Coroutine, Iterator
from dataclasses import dataclass, field
from itertools import groupby, pairwise
from operator import attrgetter
from typing import Any, Final, NamedTuple

from robotiq_async import ConnectionLostError, Finger, RobotiqError, State
from robotiq_async.fleet.errors import ControlLostError
from robotiq_async.fleet.network.bus import Urgency
from robotiq_async.fleet.wire.envelope import AgentCall, unpack_answer
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.docs.pages import read, table
from tests.fleet.lab import LEFT
from tests.fleet.world import PROMPT_S, WINDOW_S, Client, World, motions

Trouble = Callable[[World], Coroutine[Any, Any, None]]
NAMED = re.compile(r"`(.+?)`")
GRADUAL = re.compile(r"(`[^`]+`(?: and `[^`]+`)*) end like (`[^`]+`(?:(?:, | or )`[^`]+`)*)")
TARGET = 100
RATE_S = 0.045
"""Below the interval between two polls: of some commands only the newest is written."""
SETTLE_S = 2.0
"""Seconds after the trouble in which everything has to come right by itself, and nothing may come late."""


# -- the client --------------------------------------------------------------------------------------------


async def client_killed(world: World) -> None:
    world.kill(world.holder.host)


def frozen(who: str, seconds: float) -> Trouble:
    async def trouble(world: World) -> None:
        host = getattr(world, who).host
        world.freeze(host)
        await asyncio.sleep(seconds)
        world.thaw(host)

    return trouble


async def client_held_up(world: World) -> None:
    """A callback that blocks: zenoh's own threads run on, and the link stays."""
    world.holder.host.freeze()
    await asyncio.sleep(2)
    world.holder.host.thaw()


# -- the agent ---------------------------------------------------------------------------------------------


async def agent_killed(world: World) -> None:
    world.kill(world.agent.host)
    await asyncio.sleep(1)
    await world.start_agent("next agent")


async def agent_ended(world: World) -> None:
    """SIGTERM, and the next one at once."""
    await world.agent.end()
    await world.start_agent("next agent")


async def second_agent(world: World) -> None:
    """Another one that does not see the first: a partition, which ends later."""
    world.network.part("agent", "second agent")
    await world.start_agent("second agent")
    world.network.join("agent", "second agent")
    await asyncio.sleep(1.5)
    await world.agents.pop().end()


# -- the network -------------------------------------------------------------------------------------------


def cut(seconds: float, *, out: bool = True, back: bool = True, keeps: bool = False) -> Trouble:
    async def trouble(world: World) -> None:
        world.network.keeps_links = keeps
        world.cut(world.holder, out=out, back=back)
        await asyncio.sleep(seconds)
        world.mend(world.holder)

    return trouble


async def router_restarted(world: World) -> None:
    """All lose all others, at once, and for two seconds."""
    names = [bus.name for bus in world.network.buses]
    pairs = [(one, other) for one in names for other in names if one < other]
    for pair in pairs:
        world.network.part(*pair)
    await asyncio.sleep(2)
    for pair in pairs:
        world.network.join(*pair)


def bad(*, requests_only: bool = False, **what: float) -> Trouble:
    async def trouble(world: World) -> None:
        here, there = world.holder.host.name, world.agent.host.name
        streams = world.network.both(here, there)[: 1 if requests_only else 2]
        usual = [{name: getattr(stream, name) for name in what} for stream in streams]
        for stream in streams:
            vars(stream).update(what)
        await asyncio.sleep(2.5)
        for stream, values in zip(streams, usual, strict=True):
            vars(stream).update(values)
            stream.free_at = min(stream.free_at, world.now())

    return trouble


async def wrong_keys(world: World) -> None:
    """A third of everything comes under the key of the other gripper."""
    world.network.wrong_key = lambda key: _swap(key) if world.network.random.random() < 0.33 else key
    await asyncio.sleep(3)
    world.network.wrong_key = lambda key: key


def _swap(key: str) -> str:
    one, other = "/left/", "/right/"
    return key.replace(one, other) if one in key else key.replace(other, one)


async def cuts(world: World) -> None:
    """One direction or both, for about a lease, again and again, while keys are mixed up."""
    # Of its own: the course shall not depend on how many messages there are.
    network, chance = world.network, random.Random(1)
    network.wrong_key = lambda key: _swap(key) if network.random.random() < 0.1 else key
    for _ in range(12):
        out, back = chance.choice(((True, False), (False, True), (True, True)))
        network.keeps_links = chance.random() < 0.5
        world.cut(world.holder, out=out, back=back)
        await asyncio.sleep(chance.uniform(0.7, 1.4))
        world.mend(world.holder)
        await asyncio.sleep(chance.uniform(0.05, 1.0))
    network.wrong_key = lambda key: key


# -- others ------------------------------------------------------------------------------------------------


async def other_acquires(world: World) -> None:
    assert await world.other.do(ending(world.other.hand.acquire())) == "ControlLost held"


async def other_takes(world: World) -> None:
    await world.other.do(world.other.hand.take())
    await asyncio.sleep(1)
    await world.other.do(world.other.hand.release())


async def other_halts(world: World) -> None:
    await world.other.do(world.other.hand.halt())


TROUBLES: Final[dict[str, Trouble]] = {
    "client killed": client_killed,
    "client frozen for 0.5 s": frozen("holder", 0.5),
    "client frozen for 3 s": frozen("holder", 3),
    "client's loop held up for 2 s": client_held_up,
    "agent frozen for 0.5 s": frozen("agent", 0.5),
    "agent frozen for 3 s": frozen("agent", 3),
    "agent killed, the next after 1 s": agent_killed,
    "agent ended, the next at once": agent_ended,
    "a second agent that did not see the first": second_agent,
    "router away for 2 s": router_restarted,
    "cable out for 0.3 s": cut(0.3),
    "cable out for 2.5 s": cut(2.5),
    "cable out for 2.5 s, and all of it comes later": cut(2.5, keeps=True),
    "nothing to the agent for 2.5 s": cut(2.5, back=False),
    "nothing to the client for 2.5 s": cut(2.5, out=False),
    "nothing to the agent for 2.5 s, and all of it comes later": cut(2.5, back=False, keeps=True),
    "nothing to the client for 2.5 s, and all of it comes later": cut(2.5, out=False, keeps=True),
    "5 % lost": bad(loss=0.05),
    "20 % lost": bad(loss=0.2),
    "50 % lost": bad(loss=0.5),
    "50 ms late": bad(delay=0.05),
    "64 kbit/s": bad(rate=8000.0),
    "requests late by 1.5 s": bad(delay=1.5, requests_only=True),
    "requests twice": bad(copies=2, requests_only=True),
    "requests out of order": bad(jitter=0.05, requests_only=True),
    "everything twice and out of order": bad(copies=2, jitter=0.05),
    "another client acquires": other_acquires,
    "another client takes": other_takes,
    "another client halts": other_halts,
    "a third under the wrong key": wrong_keys,
    "12 cuts around the lease, a tenth under the wrong key": cuts,
}


# -- what the holder does, and what is promised ------------------------------------------------------------


@dataclass
class Doing:
    """The actions of the holder.

    Attributes:
        asked: the requests of a control loop, with their times.
        call: ends when the call or the loop of the holder does; None if there is none.
    """

    world: World
    asked: dict[tuple[int, int], float] = field(default_factory=dict)
    call: asyncio.Task[str] | None = None
    writes: int = 0
    goes_on: bool = True

    def begin(self, work: Coroutine[Any, Any, Any]) -> None:
        self.call = self.world.holder.host.create_task(ending(work))

    async def loop(self) -> None:
        """A control loop: each of its commands has a position and a speed of its own."""
        hand, world = self.world.holder.hand, self.world
        number = 0
        while self.goes_on:
            value = (TARGET + number % 20, number // 20)
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
LOOP = "a control loop"
"""The phase in which commands are sent during the trouble."""
OTHERS = tuple(phase for phase in PHASES if phase != LOOP)


async def outcome(world: World, phase: str, trouble: Trouble) -> tuple[str, float | None]:
    """Let it happen.

    Returns:
        The words of the table, and the seconds from the beginning of the trouble until nothing moved; None if
        it moved on.

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
        fingers = "rest"
    check_commands(doing)
    check_travel(world, Finger.A)
    words = f"{what}, {fingers}, {lease_of(world)}"
    await works(world)
    world.check()
    return words, held


async def said(doing: Doing) -> str:
    """The result of the holder: the outcome of its call, else the observation of its hand."""
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
    """The time when the fingers last moved."""
    since = world.now()
    while True:
        await asyncio.sleep(0.04)  # a fifth of what is allowed beside the window
        if world.gripper.is_moving:
            since = world.now()
        elif world.now() - since > 1.0:
            return since


async def _fingers(doing: Doing, resting: asyncio.Task[float], began: float) -> tuple[str, float | None]:
    """The position at which they came to rest, and the time until then."""
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
    order = {what: number for number, what in enumerate(doing.asked)}
    numbers = [order[what] for _, what in done]
    assert all(one < other for one, other in pairwise(numbers)), "carried out twice, or out of turn"
    late = [(at - doing.asked[what]) for at, what in done]
    assert all(each <= WINDOW_S + PROMPT_S for each in late), f"carried out late: {max(late):.2f} s"


def commands(doing: Doing) -> list[tuple[float, tuple[int, int]]]:
    """Its commands that reached the gripper, with their times."""
    found: list[tuple[float, tuple[int, int]]] = []
    for at, what in motions(doing.world, doing.writes):
        if what in doing.asked and (not found or found[-1][1] != what):
            found.append((at, what))
    return found


def check_travel(world: World, addressed: Finger) -> None:
    moved = {axis: world.moved(axis) for axis in THREE_FINGER.axes if axis not in addressed}
    assert not any(moved.values()), f"axes moved that were not addressed: {moved}"


def lease_of(world: World) -> str:
    """The fate of the lease, and whether the holder noticed."""
    holder = world.holder
    if holder.host.is_dead:
        return "ended"
    if not holder.hand.is_in_control:
        return "lost"
    return "back" if False in holder.had_control else "kept"


async def ending(work: Coroutine[Any, Any, Any]) -> str:
    """The outcome of a call, in the words of the table."""
    try:
        await work
    except ControlLostError as error:
        return f"ControlLost {error.reason}"
    except ConnectionLostError:  # also without an answer
        return "ConnectionLost"
    except RobotiqError as error:
        return type(error).__name__.removesuffix("Error")
    return "done"


async def works(world: World) -> None:
    """A halt of any client is carried out; then the hand is as good as new."""
    holder, other = world.holder, world.other
    at = world.now()
    heard = await other.do(ending(other.hand.halt()))
    assert heard == "done", heard
    assert world.now() - at < 1.0
    assert not world.gripper.is_moving
    commander = other if holder.host.is_dead else holder
    if commander is holder:
        # A client that lost the lease to a halt does not come back by itself.
        await asyncio.sleep(0.7)
        assert not holder.hand.is_in_control, "the old holder came back after a halt"
    await commander.do(commander.hand.acquire())
    await world.settle()
    result = await commander.do(commander.hand.move(40, Finger.B, speed=255))
    assert abs(result.positions[Finger.B] - 40) <= 2
    check_travel(world, Finger.B)


# -- the table ---------------------------------------------------------------------------------------------


class Cell(NamedTuple):
    """A trouble in one cell.

    Attributes:
        row: of the table; the sentences about gradual troubles are rows as well.
        outcomes: the words of each outcome that there may be.
        held_after: the limit in seconds; None for none.
    """

    row: int
    trouble: str
    phase: str
    outcomes: tuple[str, ...]
    held_after: float | None


def cells() -> Iterator[Cell]:
    """Every trouble in every cell of the table; the gradual ones end like one of several rows."""
    head, *rows = table("fleet-under-fault.md")
    told: dict[str, list[str]] = {}
    for row, (troubles, *outcomes, limit) in enumerate(rows):
        held_after = None if limit == "-" else float(limit.removesuffix(" s"))
        for trouble in NAMED.findall(troubles):
            told[trouble] = outcomes
            for phase, outcome in zip(head[1:-1], outcomes, strict=True):
                yield Cell(row, trouble, phase, (outcome,), held_after)
    gradual = GRADUAL.findall(" ".join(read("fleet-under-fault.md").split()))
    assert len(gradual) == 2, "the sentences about gradual troubles"
    for row, (troubles, others) in enumerate(gradual, len(rows)):
        alike = [told[each] for each in NAMED.findall(others)]
        for trouble in NAMED.findall(troubles):
            for phase, *each in zip(head[1:-1], *alike, strict=True):
                yield Cell(row, trouble, phase, tuple(each), None)


def tried() -> Iterator[Cell]:
    """The cells that are tried: every trouble during a control loop, and by turns in the other phases.

    In those the troubles of a row differ in nothing but the renewals of the lease, and the answer to a move.
    Each cell of the table is tried by one trouble at least.
    """
    for _, row in groupby(cells(), attrgetter("row")):
        troubles = [list(each) for _, each in groupby(row, attrgetter("trouble"))]
        turns = min(len(troubles), len(OTHERS))
        for number, each in enumerate(troubles):
            its_turn = {phase for turn, phase in enumerate(OTHERS) if (turn - number) % turns == 0}
            yield from (cell for cell in each if cell.phase in its_turn | {LOOP})


# -- a motion that lasts, and requests by hand -------------------------------------------------------------


async def move_slowly(here: World) -> asyncio.Task[str]:
    doing = Doing(here)
    await moving(doing)
    assert doing.call is not None
    return doing.call


async def ask(client: Client, verb: str, call: AgentCall, key: str = "") -> RobotiqError | None:
    """Send a request by hand; return the error that refused it."""

    async def once() -> bytes:
        reply = await client.bus.ask(key or LEFT.key(verb), call.pack(), timeout=2.0, urgency=Urgency.COMMAND)
        assert reply is not None
        return reply.payload

    answer = unpack_answer(await client.do(once()))
    try:
        answer.outcome(RobotiqStatus.from_raw)
    except RobotiqError as error:
        return error
    return None
