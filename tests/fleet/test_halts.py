"""Halts: of one gripper and of all, from anybody, and what a halt that failed says.

A project and a number in a docstring: the issue in which it went wrong with that project's robots.
"""

from __future__ import annotations

import asyncio
import contextlib
import gc

import pytest

from robotiq_async import Finger, State
from robotiq_async.fleet.fleet import Fleet
from robotiq_async.fleet.remote.requests import NoAnswerError
from robotiq_async.fleet.remote.stops import until_answered
from robotiq_async.fleet.wire.envelope import Call
from robotiq_async.fleet.wire.names import GripperName
from robotiq_async.values.errors import NotAllowedError, NotAllStoppedError, RobotiqStateError
from tests.fleet.by_hand import LEFT, ask, move_slowly
from tests.fleet.cell import told
from tests.fleet.world import motions, world
from tests.virtual import VirtualLoop, virtual


@virtual
async def test_a_second_halt_is_not_dropped_as_a_duplicate() -> None:
    """strands-labs/robots 1617. The very same request, once more, stops what has been set going since."""
    async with world() as here:
        halt = Call(LEFT.base, "somebody", number=1)
        for _ in range(2):
            call = await move_slowly(here)
            assert await ask(here.other, "halt", halt) is None
            assert not here.gripper.is_moving
            assert await call == "ControlLost halted"
            await here.holder.do(here.holder.hand.acquire())
            await here.holder.do(here.holder.hand.move(0, Finger.A, speed=255))


@virtual
async def test_a_halt_needs_no_lease() -> None:
    """strands-labs/robots 3450: a stop was refused under somebody else's lock."""
    async with world() as here:
        call = await move_slowly(here)
        await here.other.do(here.other.hand.halt())
        assert not here.gripper.is_moving
        assert await call == "ControlLost halted"


@virtual
async def test_a_halt_that_failed_is_not_counted_as_one() -> None:
    """strands-labs/robots 1680."""
    async with world() as here, Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        await here.servers["left"].stop()
        await here.until(lambda: here.other.hand.state is State.DISCONNECTED)
        with pytest.raises(NotAllStoppedError) as failed:
            await fleet.halt_all()
        assert failed.value.outcomes[GripperName("lab", "cell", "right")] == "stopped"
        assert failed.value.outcomes[LEFT].startswith("refused: ")
        assert await here.other.do(told(here.other.hand.halt())) == "ConnectionLost"
        await here.servers["left"].start()


@virtual
async def test_halting_an_empty_fleet_is_an_error() -> None:
    """strands-labs/robots 3434: an e-stop succeeded on a mesh that was not started."""
    async with world() as here, Fleet("elsewhere", bus=here.network.bus("console")) as fleet:
        with pytest.raises(NotAllStoppedError, match="no gripper"):
            await fleet.halt_all()
    with pytest.raises(RuntimeError, match="not entered"):
        await Fleet("lab", bus=here.network.bus("console")).halt_all()


@virtual
async def test_a_halt_of_all_names_what_it_did_not_reach() -> None:
    """An endpoint of its route was down, and "all" of the others stopped."""
    async with world() as here:
        bus = here.network.bus("console")
        bus.endpoints = ["agent", "tls/cell-2:7447"]
        async with Fleet("lab", bus=bus) as fleet:
            with pytest.raises(NotAllStoppedError) as failed:
                await fleet.halt_all()
            assert str(failed.value) == "halted 2 of 2; not reached: tls/cell-2:7447"
            assert failed.value.unreached == ("tls/cell-2:7447",)
            assert set(failed.value.outcomes.values()) == {"stopped"}
            here.kill(here.agent.host)
            await asyncio.sleep(1)
            with pytest.raises(NotAllStoppedError) as failed:
                await fleet.halt_all()
            left, right = "zenoh://lab/cell/left: no answer", "zenoh://lab/cell/right: no answer"
            assert str(failed.value) == f"halted 0 of 2; {left}; {right}; not reached: agent, tls/cell-2:7447"
            await here.start_agent("agent")


@virtual
async def test_a_halt_of_all_looks_on_for_links_that_come_up_late() -> None:
    """It knew nothing of agents whose links came up after it had looked; somebody else looks on meanwhile."""
    async with world() as here, Fleet(bus=here.network.bus("screen")) as screen:
        changes = screen.changes()
        call = await move_slowly(here)
        here.network.part("agent", "console")
        here.network.loop.call_later(1.0, here.network.join, "agent", "console")
        async with Fleet("lab", bus=here.network.bus("console")) as fleet:
            assert await fleet.halt_all() == {
                GripperName("lab", "cell", name): "stopped" for name in ("left", "right")
            }
        assert not here.gripper.is_moving
        assert await call == "ControlLost halted"
        assert list(changes.drain())


@virtual
async def test_a_halt_is_acknowledged_however_slowly() -> None:
    """A round trip that is longer than the time between two attempts."""
    async with world() as here, Fleet("lab", bus=here.network.bus("console")) as fleet:
        await move_slowly(here)
        for name in ("other", "console"):
            for stream in here.network.both(name, "agent"):
                stream.delay = 0.4
        await here.other.do(here.other.hand.halt())
        assert set((await fleet.halt_all()).values()) == {"stopped"}


@virtual
async def test_what_was_asked_before_a_halt_does_not_go_out_after_it() -> None:
    async with world() as here:
        hand = here.holder.hand
        for stream in here.network.both("holder", "agent"):
            stream.delay = 0.05

        async def loop_and_halt() -> None:
            for number in range(40):  # more than may be under way: the last ones wait
                hand.command(Finger.A, position=200 + number, speed=0)
                await asyncio.sleep(0.002)
            await hand.halt()

        await here.holder.do(loop_and_halt())
        writes = len(here.gripper.writes)
        await asyncio.sleep(1)
        assert not here.gripper.is_moving
        assert not motions(here, writes)


@virtual
async def test_two_answers_in_one_turn_leave_no_exception_behind() -> None:
    """The second one's was never retrieved, and the event loop complained."""
    loop = asyncio.get_running_loop()
    assert isinstance(loop, VirtualLoop)
    answered = asyncio.Event()
    asked = 0

    async def attempt(_: float) -> None:
        nonlocal asked
        asked += 1
        if asked == 2:
            loop.call_later(0.01, answered.set)
        await answered.wait()
        raise RobotiqStateError("refused")

    with contextlib.suppress(
        RobotiqStateError
    ):  # and nothing keeps its traceback, with what was awaited in it
        await until_answered(attempt, 2.0)
    assert asked == 2
    gc.collect()
    assert not loop.complaints


@virtual
async def test_a_halt_that_was_denied_is_not_called_lost_because_the_last_attempt_had_no_time() -> None:
    """On a busy machine a reader's halt ended as a lost connection: the last attempt had 9 ms."""

    async def attempt(left: float) -> None:
        if left > 0.2:
            raise NotAllowedError("access denied")
        await asyncio.sleep(left)
        raise NoAnswerError("no answer in time")

    with pytest.raises(NotAllowedError):
        await until_answered(attempt, 2.0)
