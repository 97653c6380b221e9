"""Every public call, cancelled in every turn of the loop while it runs, in the ways people cancel."""

from __future__ import annotations

import asyncio
from collections.abc import Awaitable, Callable
from dataclasses import dataclass
from itertools import count
from typing import Any, Literal

import anyio
import pytest

from robotiq_async import (
    ConnectionLostError,
    Fault,
    Finger,
    MoveTimeoutError,
    NotStartedError,
    RobotiqConnectionError,
    RobotiqHand,
    State,
    StateTimeoutError,
)
from robotiq_async.simulator import Trouble
from robotiq_async.values.states import RUNNING
from tests.adversity.world import World, started, world
from tests.virtual import inside, run

A, B, C = Finger.A, Finger.B, Finger.C
TARGET = 120
SPEEDUP = 40.0
"""Slow enough for a move to take a dozen polls, fast enough to walk through all of them."""

AXIS_STOPS_WITHIN = 48
"""Counts: at this speed an axis moves 10 in a poll of 10 ms, and two polls and a device cycle may pass."""

Way = Literal["task.cancel", "asyncio.timeout", "anyio"]
EVERY_FIFTH: dict[int, Way] = {3: "anyio", 4: "asyncio.timeout"}
"""Turns, of five, with another way beside ``task.cancel``. A scope of anyio cancels until it is left, and
hides a cancellation that is swallowed."""
TIMED_OUT = ("move", "start, active", "stop")
"""The calls that time out here. A time-out calls ``task.cancel()`` once, and all else it does is outside
the call: no call distinguishes the two."""
Call = Callable[[World], Awaitable[Any]]


@dataclass(frozen=True)
class Walk:
    """A call, the state it is made in, and where the hand is when the call was cancelled.

    Attributes:
        call: makes the call.
        ready: brings the hand there.
        ends: the states in which the hand may come to rest.
        speedup: of the gripper.
    """

    call: Call
    ready: Callable[[World], Awaitable[None]]
    ends: tuple[State, ...] = (State.RUNNING_IDLE,)
    speedup: float = SPEEDUP


async def active(world: World) -> None:
    await world.activate_beforehand()
    await world.hand.start()


async def reset(world: World) -> None:
    await world.hand.start(activate=False)


async def in_fault(world: World) -> None:
    await active(world)
    world.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await world.until_state(State.FAULT)


async def moving(world: World) -> None:
    await active(world)
    await world.hand.set_speed(0)
    await world.hand.set_position(TARGET, A)


async def nothing(world: World) -> None:
    """The hand is not started."""


async def whole_life(world: World) -> None:
    async with RobotiqHand(world.server.address, poll_interval=0.03) as hand:
        await hand.move(TARGET, A, speed=0)


async def never_in_reset(world: World) -> None:
    with pytest.raises(StateTimeoutError):
        await world.hand.wait_for_state(State.RESET, timeout=0.1)


async def next_transition(world: World) -> None:
    stream = world.hand.transitions()
    world.hand.command(A, position=TARGET)
    await anext(stream)  # RUNNING_CC, at once
    await anext(stream)


FAST = 2000.0
RESTS = (State.RUNNING_IDLE, State.RESET)
WALKS = {
    "start, active": Walk(lambda world: world.hand.start(), World.activate_beforehand, (State.SHUTDOWN,)),
    "start, reset": Walk(lambda world: world.hand.start(), nothing, (State.SHUTDOWN,), FAST),
    "stop": Walk(lambda world: world.hand.stop(), moving, (State.SHUTDOWN,)),
    "async with": Walk(whole_life, World.activate_beforehand, (State.DISCONNECTED,)),
    "set_position": Walk(lambda world: world.hand.set_position(TARGET, A), active),
    "set_speed": Walk(lambda world: world.hand.set_speed(7), active),
    "set_force": Walk(lambda world: world.hand.set_force(7), active),
    "move": Walk(lambda world: world.hand.move(TARGET, A, speed=0), active),
    "open": Walk(lambda world: world.hand.open(A), moving),
    "close": Walk(lambda world: world.hand.close(A), active),
    "hold": Walk(lambda world: world.hand.hold(), moving),
    "halt": Walk(lambda world: world.hand.halt(), moving),
    "activate": Walk(lambda world: world.hand.activate(), reset, RESTS, FAST),
    "reset": Walk(lambda world: world.hand.reset(), active, RESTS),
    "atr": Walk(lambda world: world.hand.atr(), in_fault, (State.FAULT, State.ATR_DONE), 150.0),
    "recover": Walk(lambda world: world.hand.recover(), in_fault, (State.FAULT, *RESTS), FAST),
    "wait_for_state": Walk(never_in_reset, active),
    "statuses": Walk(lambda world: anext(world.hand.statuses()), active),
    "transitions": Walk(next_transition, active),
}


@pytest.mark.parametrize("name", WALKS)
def test_cancelled_in_every_turn(name: str) -> None:
    walk = WALKS[name]
    for turn in count(2):  # in the first turn the call has not begun
        if cancelled_in(walk, "task.cancel", turn) == "ended before":
            break
        other = EVERY_FIFTH.get(turn % 5)
        if other is not None and (other == "anyio" or name in TIMED_OUT):
            cancelled_in(walk, other, turn)
    assert turn > 2, "there was nothing to cancel"


def cancelled_in(walk: Walk, way: Way, turn: int) -> str:
    try:
        return run(lambda: cancelled(walk, way, turn))
    except BaseException as error:
        error.add_note(f"{way} in turn {turn}")
        raise


async def cancelled(walk: Walk, way: Way, turn: int) -> str:
    """Cancel the call after so many turns of the loop, check the remains, and return its outcome."""
    async with world(speedup=walk.speedup) as here:
        await walk.ready(here)
        how = await call_cancelled(here, walk.call, way, turn)
        gone = here.gripper.travel(A)
        await rest(here)
        if how == "cancelled":
            assert here.hand.state in walk.ends, here.hand.state
            if walk in (WALKS["move"], WALKS["async with"]):
                assert here.gripper.travel(A) - gone <= AXIS_STOPS_WITHIN, "it was not stopped"
        if how != "ended before" and here.hand.state is not State.DISCONNECTED:
            await check_nothing_is_left(here)
        return how


async def call_cancelled(world: World, call: Call, way: Way, turn: int) -> str:
    """Make the call and cancel it; return whether it was cancelled, ended all the same, or ended before."""
    asked: list[float] = []
    scope, limit = anyio.CancelScope(), asyncio.timeout(None)

    async def caller() -> str:
        if way == "anyio":
            with scope:
                await call(world)
            return "cancelled" if scope.cancelled_caught else "ended"
        if way == "asyncio.timeout":
            try:
                async with limit:
                    await call(world)
            except TimeoutError:
                assert limit.expired()
                return "cancelled"
            return "ended"
        await call(world)
        return "ended"

    def cancel() -> None:
        if task.done():
            return
        asked.append(world.loop.time())
        if way == "anyio":
            scope.cancel()
        elif way == "asyncio.timeout":
            limit.reschedule(world.loop.time())
        else:
            task.cancel()

    task = asyncio.create_task(caller())
    world.loop.after_turns(turn, cancel)
    await asyncio.wait({task})
    if not asked:
        return "ended before"
    assert world.loop.time() - asked[0] < 2.0, "it took its time to end"
    how = "cancelled" if task.cancelled() else task.result()
    assert way != "task.cancel" or how == "cancelled", "the cancellation was swallowed"
    return how


async def rest(world: World) -> None:
    """Wait until nothing moves, nothing is written and the hand stays where it is."""
    async with asyncio.timeout(60):
        while True:
            state, writes = world.hand.state, len(world.gripper.writes)
            await asyncio.sleep(0.1)
            at_rest = not world.gripper.is_moving and len(world.gripper.writes) == writes
            if world.hand.state is state and at_rest and settled(world.hand):
                return


def settled(hand: RobotiqHand) -> bool:
    return hand.state in (*RUNNING, State.RESET, State.FAULT, State.ATR_DONE, State.SHUTDOWN) or (
        hand.state is State.DISCONNECTED and not is_started(hand)
    )


def is_started(hand: RobotiqHand) -> bool:
    try:
        _ = hand.status
    except NotStartedError:
        return False
    except RobotiqConnectionError:  # it looks for its link
        return True
    return True


async def check_nothing_is_left(world: World) -> None:
    """Nothing is pending, the link is in step, and the next command moves only its axis.

    That no caller is left waiting is tested below the hand: tests/control/test_moves.py and
    tests/local/test_session_waits.py.
    """
    hand = world.hand
    assert hand.statistics.reconnects == 0
    world.check_no_stale_status()
    if hand.state is State.SHUTDOWN:
        assert not world.gripper.is_moving
        await hand.start()
    before = world.travels() if hand.state in RUNNING else None
    await hand.recover()
    before = before or world.travels()  # an activation moves everything
    # Wherever it was stopped: somewhere else.
    await hand.move(60 if world.gripper.position(B) > 100 else 180, B, speed=255)
    assert {axis for axis, travel in world.travels().items() if travel != before[axis]} == {B}


# -- when another call takes over one of its axes at that moment ---------------------------------------------


@inside(started)
@pytest.mark.parametrize("is_sent", [False, True])
@pytest.mark.parametrize("way", ["cancelled first", "taken over first", "one axis after the other", "held"])
async def test_a_cancelled_move_whose_axis_is_taken_over_does_not_go_on_with_the_others(
    here: World, way: str, is_sent: bool
) -> None:
    """Its caller saw the cancellation and no MoveSupersededError, and counted on A to be held."""
    hand = here.hand
    moving = asyncio.create_task(hand.move(255, A | B | C, speed=0))
    await (here.until_moving() if is_sent else asyncio.sleep(0))
    if way == "cancelled first":
        moving.cancel()
    holding = asyncio.create_task(hand.hold(C)) if way == "held" else None
    if holding is None:
        hand.command(C, position=40)
    else:
        await asyncio.sleep(0)
    if way == "one axis after the other":
        hand.command(B, position=40)
    moving.cancel()
    await asyncio.wait({moving} if holding is None else {moving, holding})
    assert moving.cancelled()
    await rest(here)
    assert here.gripper.position(A) < 50, "it went on, or even began"
    assert abs(here.gripper.position(C) - 40) <= 2 or way == "held"
    assert abs(here.gripper.position(B) - 40) <= 2 or way != "one axis after the other"


@inside(started)
async def test_a_move_that_times_out_as_its_axis_is_taken_over_does_not_go_on_with_the_others(
    here: World,
) -> None:
    moving = asyncio.create_task(here.hand.move(255, A | B, speed=0, timeout=1.0))
    await asyncio.sleep(0)
    here.loop.call_later(1.0, lambda: here.hand.command(B, position=40))
    with pytest.raises(MoveTimeoutError):
        await moving
    await rest(here)
    assert here.gripper.position(A) < 200
    assert abs(here.gripper.position(B) - 40) <= 2


# -- when the link fails at that moment ---------------------------------------------------------------------


@inside(started)
@pytest.mark.parametrize("trouble", [Trouble("silence"), Trouble("close"), Trouble("drop", on="write")])
async def test_a_cancelled_move_stops_also_when_the_link_fails_at_that_moment(
    here: World, trouble: Trouble
) -> None:
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    await asyncio.sleep(0.3)
    async with here.server.fault_injector.making(trouble):
        moving.cancel()
        await asyncio.sleep(0.3)
    await asyncio.sleep(0.3)
    await here.nothing_moves_for(3)
    assert here.hand.state is State.RUNNING_IDLE
    assert here.gripper.position(A) < 200


@inside(started)
@pytest.mark.parametrize("turns", range(1, 12))
async def test_a_move_cancelled_in_the_turn_of_a_link_loss_is_held_or_reports_it(
    here: World, turns: int
) -> None:
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    await asyncio.sleep(0.3)
    await here.server.fault_injector.begin(Trouble("close"))
    here.loop.after_turns(turns, moving.cancel)
    await asyncio.wait({moving})
    await asyncio.sleep(4)
    if moving.cancelled():
        assert here.gripper.position(A) < 150
    else:
        assert isinstance(moving.exception(), ConnectionLostError)
