"""Differences on another host: each row of the table in docs/how-to/fleet.md, on both hands."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from typing import NamedTuple

import pytest

from robotiq_async import RobotiqError, RobotiqHand, State
from robotiq_async.fleet.remote.remote_hand import RemoteHand
from robotiq_async.hands import Hand
from tests.contract.bench import A, Bench, contract, ended
from tests.docs.pages import table
from tests.virtual import until


class Row(NamedTuple):
    what: str
    local: str
    remote: str


def rows() -> dict[str, Row]:
    _, *rows = table("how-to/fleet.md", "## What differs")
    return {row[0]: Row(*row) for row in rows}


def only_reads(here: Bench) -> Hand:
    """A second hand: one of this process cannot be made to only read."""
    return here.make() if here.lab is None else here.lab.client("reader", control=False)


async def outcome(work: Awaitable[object], word: str) -> str:
    """A word for how it ends."""
    try:
        await work
    except RobotiqError as error:
        return type(error).__name__
    return word


async def network_down(here: Bench, seconds: float) -> None:
    """Nothing gets through for a while; messages sent in that time come late."""
    if here.lab is None:  # there is no network
        return
    streams = here.lab.network.both("client 0", "agent")
    for stream in streams:
        stream.is_cut = True
    await asyncio.sleep(seconds)
    here.lab.network.mend(*streams)


# -- the rows ----------------------------------------------------------------------------------------------


async def start_twice(here: Bench) -> str:
    async with here.make():
        return await outcome(here.make().start(), "started")


async def start_to_read(here: Bench) -> str:
    async with here.make():
        second = only_reads(here)
        word = await outcome(second.start(), "started")
        await second.stop()
        return word


async def start_reset(here: Bench) -> str:
    here.gripper.write(0, [0] * 8)
    await asyncio.sleep(0.1)
    hand = only_reads(here)
    await hand.start()
    word = {State.RESET: "left in RESET", State.RUNNING_IDLE: "activated"}[hand.state]
    await hand.stop()
    return word


async def stop_reading(here: Bench) -> str:
    hand = only_reads(here)
    await hand.start()
    await other_moves(here)
    await hand.stop()
    return "fingers keep moving" if here.gripper.is_moving else "fingers stop"


async def other_moves(here: Bench) -> None:
    """Another client of the gripper sets it going."""
    registers = list(here.gripper.request_registers)
    registers[0], registers[1] = 0x0900, 0x00FF
    here.gripper.write(0, registers)
    await here.moves()


async def second_halt(here: Bench) -> str:
    async with here.make() as hand:
        moving = await here.moving(hand.move(255, speed=0))
        second = only_reads(here)
        try:
            await second.start()
        except RobotiqError:
            moving.cancel()
            await ended(moving)
            return "impossible"
        await second.halt()
        assert not here.gripper.is_moving
        await second.stop()
        assert type(await ended(moving)).__name__ == "ControlLostError"
        assert await outcome(hand.set_speed(3), "done") == "ControlLostError"
        return "stops, and the first hand has lost control"


async def after_stop(here: Bench) -> str:
    async with here.make():
        pass
    another = RobotiqHand(here.server.address)
    word = await outcome(another.start(), "started")
    await another.stop()
    return word


async def cut_move(here: Bench) -> str:
    async with here.make() as hand:
        moving = await here.moving(hand.move(255, A, speed=40))
        await network_down(here, 3.0)
        word = await outcome(moving, "done")
        if here.gripper.position(A) < 200:
            await until(lambda: not here.gripper.is_moving)
            word += ", held by the agent"
        return word


async def silent_state(here: Bench) -> str:
    async with here.make() as hand:
        waiting = asyncio.create_task(network_down(here, 3.0))
        await asyncio.sleep(2.5)
        word = hand.state.name
        await waiting
        await hand.wait_for_state(State.RUNNING_IDLE)
        return word


async def back_again(here: Bench) -> str:
    async with here.make() as hand:
        lease = here.lab and here.lab.lease
        await network_down(here, 3.0)
        await hand.wait_for_state(State.RUNNING_IDLE)
        if isinstance(hand, RemoteHand):
            await until(lambda: hand.is_in_control)
        word = await outcome(hand.set_speed(7), "done")
        assert here.last_write.axes[0].speed == 7
        if here.lab is not None and here.lab.lease != lease:
            word += ", under a new lease"
        return word


async def lost_messages(here: Bench) -> str:
    async with here.make() as hand:
        statuses, transitions = hand.statuses(buffer=10_000), hand.transitions()
        first = await anext(statuses)
        if here.lab is not None:
            stream = here.lab.network.stream("agent", "client 0")
            stream.is_cut = True
            await asyncio.sleep(0.05)
            here.lab.network.mend(stream)
        await hand.set_position(20)
        await asyncio.sleep(0.1)
        sequences = [status.sequence for status in (first, *statuses.drain())]
        assert [each.target for each in transitions.drain()] == [State.RUNNING_CC, State.RUNNING_IDLE]
        gaps = len(sequences) < sequences[-1] - sequences[0] + 1
        return "some are missing" if gaps else "every one"


async def fresh_figures(here: Bench) -> str:
    async with here.make() as hand:
        await hand.move(30, A)
        if hand.statistics.moves.get("reached") == 1:
            return "counted"
        await asyncio.sleep(1.3)
        assert hand.statistics.moves["reached"] == 1
        return "counted about a second later"


async def figures_of_another_start(here: Bench) -> str:
    hand = here.make()
    for _ in range(2):
        await hand.start()
        await hand.move(30, A)
        await asyncio.sleep(1.1)
        await hand.stop()
    return {1: "start at 0", 2: "continue"}[hand.statistics.moves["reached"]]


async def names(here: Bench) -> str:
    has = {hasattr(here.make(), name) for name in ("acquire", "take", "release", "is_in_control")}
    return {True: "there", False: "no such names"}[has.pop()]


PROBES: dict[str, Callable[[Bench], Awaitable[str]]] = {
    "`start()`, and another hand commands the gripper": start_twice,
    "`start()` of a second hand that only reads": start_to_read,
    "`start()` of a hand that only reads, and the gripper is reset": start_reset,
    "`stop()` of a hand that only reads": stop_reading,
    "`halt()` of a second hand": second_halt,
    "after `stop()`: a `RobotiqHand` on the same gripper": after_stop,
    "the network is down for 3 s during `move()`": cut_move,
    "`state` while nothing is heard of the agent": silent_state,
    "when the network is back: `set_speed()`": back_again,
    "`statuses()` when messages are lost": lost_messages,
    "`statistics.moves` right after a `move()`": fresh_figures,
    "`statistics` after another start": figures_of_another_start,
    "`acquire()`, `take()`, `release()`, `is_in_control`": names,
}


@contract
@pytest.mark.parametrize("what", PROBES)
async def test_a_row(here: Bench, what: str) -> None:
    row = rows()[what]
    assert await PROBES[what](here) == (row.local if here.lab is None else row.remote)


def test_every_row_is_tried_and_says_of_what_differs_why() -> None:
    table = rows()
    assert list(table) == list(PROBES)
    assert all(row.local != row.remote for row in table.values())
