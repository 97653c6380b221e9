"""One cell of the tables of docs/under-fault.md: one trouble in one phase, and all that is promised then."""

from __future__ import annotations

import asyncio
import re
from collections.abc import AsyncIterator, Awaitable, Callable, Collection, Iterator
from contextlib import asynccontextmanager
from dataclasses import replace
from itertools import groupby, pairwise
from typing import NamedTuple, Self

from robotiq_async import Finger, RobotiqError, State
from robotiq_async.hands.waiting import STALLED_S
from robotiq_async.link.urcap.transport import LOST_S
from robotiq_async.simulator import parse_troubles
from robotiq_async.simulator.troubles.trouble import KINDS
from robotiq_async.values.registers import Registers
from robotiq_async.values.states import RUNNING
from tests.adversity.phases import PHASES, TARGET, Call, Phase
from tests.adversity.world import HABITS, UrcapServer, World
from tests.docs.pages import read, table

LINE_PULLED = "line pulled"
"""A trouble that is not the simulator's: the serial port is gone."""
PATIENCE_S = 2.0
"""Seconds that a trouble lasts when the call does not end because of it; then it ends, and the call may."""
IDLE_S = 1.0
"""Seconds that a trouble lasts when there is no call, and that one for ever goes on after the call."""
REST_S = 0.6 if HABITS else 0.4
"""Seconds for which a hand at rest stays in its state: four polls, and longer than any status lags."""
ESCALATION_S = 5.0
"""Interference is a major fault after this time (20 s of the gripper, which is five times as fast)."""
STOP_S = 2.0
"""Seconds that a stop takes at most, as promised: the phases that end so are stops."""
STUCK = (State.WF_ACTIVATION, State.WF_ATR)
"""States in which a sequence that does not continue until a reset leaves the hand."""
MOVES_EVERYTHING = ("foreign", "release")
FORGETS = ("power-cut", "stranded")
"""Troubles with which the gripper has no request any more."""
SETTLED = (*RUNNING, State.RESET, State.FAULT, State.ATR_DONE, State.SHUTDOWN)


async def outcome(world: World, phase: Phase, words: str) -> str:
    """Let it happen; return the outcome of the call and the hand's last state, as in the table.

    Raises:
        AssertionError: a promise was broken.
    """
    world.loop.watch_holds()
    call = await phase.reach(world)
    if call is not None and phase.name == "connecting" and words in ("reset", "close"):
        call = await _begun(world, call)  # there must be a connection to lose
    before = Before.of(world)
    async with trouble(world, words, on_write=phase.on_write) as end:
        task = None if call is None else asyncio.ensure_future(call())
        await asyncio.wait({task or asyncio.ensure_future(asyncio.sleep(IDLE_S))}, timeout=PATIENCE_S)
        if words.endswith("for ever"):
            await asyncio.sleep(ESCALATION_S if words.startswith("interference") else IDLE_S)
        else:
            await end()
        kind, bound = words.split()[0], phase.bound
        if kind == "e-stop" and phase.name == "connecting":
            bound += STALLED_S  # connected in time, start() waits for an activation that makes no progress
        ending = _noticed(world) if task is None else await _ending_of(task, before.time + bound)
        if kind == "lost-set":
            await asyncio.sleep(2 * LOST_S)  # it is noticed by what is not shown
        await _rest(world, (*SETTLED, *STUCK) if _stays_stuck(kind, phase) else SETTLED)
        state = world.hand.state
        if phase.name == "keeping a grip":
            ending += ", kept" if world.gripper.grips == world.holds else ", let go"
        if phase.bound == STOP_S and abs(world.gripper.position(Finger.A) - TARGET) <= 2:
            ending += ", fingers went on"
        _check_motions(world, before, phase, kind, ending)
        await _works(world, activate=kind != "e-stop")
        world.check_no_stale_status()
        world.check_loop()
    return f"{ending} → {state.name}"


class Before(NamedTuple):
    """The world when the trouble began."""

    time: float
    travels: dict[Finger, float]
    writes: int
    requests: Registers

    @classmethod
    def of(cls, world: World) -> Self:
        world.states.clear()
        if isinstance(world.server, UrcapServer):
            world.server.motions.clear()
        gripper = world.gripper
        return cls(world.loop.time(), world.travels(), len(gripper.writes), gripper.request_registers)


@asynccontextmanager
async def trouble(
    world: World, words: str, *, on_write: bool
) -> AsyncIterator[Callable[[], Awaitable[None]]]:
    """A trouble that lasts until what this yields is called and awaited, at most as long as the block."""
    if words == LINE_PULLED:
        assert world.line is not None
        line = world.line
        line.pull()

        async def plug() -> None:
            line.plug()

        yield plug
        return
    (what,) = parse_troubles(words)
    if on_write and KINDS[what.kind].corruption is not None:
        what = replace(what, on="write")
    ongoing = await world.server.fault_injector.begin(what)

    async def end() -> None:
        await world.server.fault_injector.end(ongoing)

    try:
        yield end
    finally:
        await end()


async def _begun(world: World, call: Call) -> Call:
    """Begin a call, and wait until the gripper has heard of it and not answered yet."""
    task = asyncio.ensure_future(call())
    await world.server.asked.wait()
    return lambda: task


async def _ending_of(task: asyncio.Future[object], deadline: float) -> str:
    """The result of the caller."""
    try:
        async with asyncio.timeout_at(deadline):
            await task
    except RobotiqError as error:
        return type(error).__name__.removesuffix("Error")
    return "done"


def _noticed(world: World) -> str:
    """The signs that the user of an idle hand could notice."""
    for state, words in (
        (State.DISCONNECTED, "link lost"),
        (State.FAULT, "fault"),
        (State.ATR_DONE, "fault"),
        (State.WF_ACTIVATION, "stuck"),
    ):
        if state in world.states:
            return words
    return "taken over" if world.hand.statistics.foreign_commands else "nothing"


def _stays_stuck(kind: str, phase: Phase) -> bool:
    """Whether the gripper may leave the hand in a sequence that does not continue."""
    return kind == "e-stop" or (kind == "stranded" and phase.name in ("activating", "releasing"))


async def _rest(world: World, settled: Collection[State]) -> None:
    """Wait until the hand stays in one state, long after whatever it moves has come to rest."""
    async with asyncio.timeout(40):
        while True:
            state, moved = world.hand.state, world.gripper.is_moving
            await asyncio.sleep(REST_S)
            moved = moved or world.gripper.is_moving
            if world.hand.state is state and state in settled and not moved:
                return


def _check_motions(world: World, before: Before, phase: Phase, kind: str, ending: str) -> None:
    """No command was sent twice, neither in a row nor the one of the phase; only addressed axes moved."""
    if isinstance(world.server, UrcapServer):
        lines = world.server.motions
        assert all(one != another for one, another in pairwise(lines)), lines
        assert sum(b" POS %d " % TARGET in line for line in lines) <= 1, lines
    motions = world.motions(before.writes)
    if kind == "one-by-one":
        motions = [motion for motion, _ in groupby(motions)]  # each variable was a write of its own
    assert all(one != another for one, another in pairwise(motions)), motions
    assert sum(motion[0] == TARGET for motion in motions) <= 1, motions
    if kind in MOVES_EVERYTHING or (kind == "stranded" and phase.name == "connecting"):
        return  # such a gripper is activated by the start
    _check_travel(world, before.travels, phase.addressed)
    if phase.name == "moving" and ending in ("GripperFault", "NotActivated"):
        assert world.gripper.position(Finger.A) < TARGET - 2, "a motion resumed after a fault"
    if phase.name == "holding" and kind not in FORGETS:
        assert world.gripper.request_registers == before.requests, "the grip was relaxed"


def _check_travel(world: World, before: dict[Finger, float], addressed: Finger) -> None:
    after = world.travels()
    moved = {axis: after[axis] - before[axis] for axis in after if axis not in addressed}
    assert not any(moved.values()), f"axes moved that were not addressed: {moved}"


async def _works(world: World, *, activate: bool) -> None:
    """The hand is as good as new: it can be recovered if need be, and moves one axis and no other.

    With ``activate`` a start alone has to make it ready.
    """
    hand = world.hand
    if hand.state is State.SHUTDOWN:
        await hand.start(activate=activate)
    if hand.state is State.FAULT and not hand.status.fault.is_known:
        await hand.reset()  # recover() would wait: a person decides about a fault that no manual names
    await hand.recover()
    before = world.travels()
    (axis,) = world.holds & (Finger.A | Finger.B)
    result = await hand.move(60, axis, speed=255)
    assert abs(result.positions[axis] - 60) <= 2
    _check_travel(world, before, axis)
    await hand.stop()
    assert hand.state is State.SHUTDOWN


# -- the table ---------------------------------------------------------------------------------------------


class Cell(NamedTuple):
    """One cell: a trouble on a kind of link, in a phase, and what comes of it."""

    trouble: str
    link: str
    phase: Phase
    outcome: str


def cells() -> Iterator[Cell]:
    """Every cell, for every kind of link it fits."""
    rows = list(_rows("## Every trouble in every phase"))
    of_lines = {words for troubles, _ in rows if is_of_lines(troubles) for words in words_in(troubles)}
    for troubles, outcomes in rows:
        for trouble in words_in(troubles):
            for words, link in variants(trouble):
                if link == "rtu" and words in of_lines and not is_of_lines(troubles):
                    continue
                if link == "tcp" and is_of_lines(troubles):
                    continue
                yield from (Cell(words, link, phase, ends[link == "rtu"]) for phase, ends in outcomes)


def cells_of_a_urcap() -> Iterator[Cell]:
    """Every cell of a jaw behind the text port of a UR: those of its table, and those like cells above it."""
    heading = "## Behind Robotiq's URCap"
    for troubles, outcomes in _rows(heading):
        for trouble in words_in(troubles):
            for words in forms(trouble):
                yield from (Cell(words, "urcap", phase, ends) for phase, (ends, _) in outcomes)
    said = re.search(r" s\. (.*?) end as over TCP above; (.*?) end as on a serial line\.", section(heading))
    assert said is not None
    for link, troubles in zip(("tcp", "rtu"), said.groups(), strict=True):
        alike = {words for trouble in words_in(troubles) for words in forms(trouble)}
        yield from (
            cell._replace(link="urcap") for cell in cells() if cell.link == link and cell.trouble in alike
        )


def cells_of_a_tunnel() -> Iterator[Cell]:
    """Every cell of a jaw through a tunnel that differs from a jaw on a serial line."""
    for troubles, outcomes in _rows("## Through a tunnel"):
        for trouble in words_in(troubles):
            yield from (Cell(trouble, "tunnel", phase, ends) for phase, (ends, _) in outcomes)


def section(heading: str) -> str:
    """The section of a heading, its lines joined."""
    text = read("under-fault.md").partition(f"\n{heading}\n")[2].partition("\n#")[0]
    return " ".join(text.split())


def _rows(heading: str) -> Iterator[tuple[str, list[tuple[Phase, tuple[str, str]]]]]:
    """The rows of a table: the troubles, and the outcome in each phase over TCP and on a serial line."""
    head, (_, *rests_in), *rows = table("under-fault.md", heading)
    phases = {phase.name: phase for phase in PHASES}
    assert head[1:] == list(phases), "a column for each phase"
    for troubles, *outcomes in rows:
        yield (
            troubles,
            [
                (phases[name], _ends(outcome, state))
                for name, outcome, state in zip(head[1:], outcomes, rests_in, strict=True)
            ],
        )


def _ends(outcome: str, rests_in: str) -> tuple[str, str]:
    """The words of a cell about TCP and about a serial line, each with the state that follows."""
    tcp, _, line = outcome.partition(" / ")
    tcp, line = (each if "→" in each else f"{each} → {rests_in}" for each in (tcp, line or tcp))
    return tcp, line


def is_of_lines(troubles: str) -> bool:
    """Whether a row is about serial lines; those in it are not meant by the other rows."""
    return troubles.startswith("on a serial line:")


def words_in(troubles: str) -> list[str]:
    """The troubles of a row."""
    return re.findall(r"`(.+?)`", troubles)


def variants(trouble: str) -> Iterator[tuple[str, str]]:
    """The forms in which a trouble of the table is tried, each with the kind of link."""
    if trouble == LINE_PULLED:
        yield trouble, "rtu"
        return
    (parsed,) = parse_troubles(trouble)
    for link in ("tcp", "rtu"):
        if KINDS[parsed.kind].link in (None, link):
            yield from ((form, link) for form in forms(trouble))


def forms(trouble: str) -> list[str]:
    """A trouble for one reply and for the whole call, where nothing is said about how long it lasts."""
    (parsed,) = parse_troubles(trouble)
    kind = KINDS[parsed.kind]
    if parsed.lasts is None and kind.corruption is not None:
        return [f"{trouble} once", f"{trouble} for 60"]
    if parsed.lasts is None and kind.lasts > 0:
        return [f"{trouble} for 60"]
    return [trouble]
