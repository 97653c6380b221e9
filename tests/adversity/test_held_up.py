"""The application holds up the event loop: it is noticed, and nothing is caught up on."""

from __future__ import annotations

import asyncio
import time
from itertools import pairwise

import pytest

from robotiq_async import Fault, Finger, NotActivatedError, RobotiqHand, State
from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.simulator import Trouble
from robotiq_async.values.request import Request
from tests.adversity.world import World, started, world
from tests.virtual import inside

A = Finger.A
POLL_S = 0.01
POLL_TURNS = 6
"""Turns of the loop from one poll to the next; they are the same in each."""


@inside(started, poll_interval=POLL_S)
async def test_missed_polls_are_counted_and_skipped(here: World) -> None:
    await anext(here.hand.statuses())
    before, given = here.hand.statistics, len(here.gripper.stamps)
    here.loop.hold_up(1.0)
    await asyncio.sleep(0.5)
    after = here.hand.statistics
    assert after.overruns - before.overruns == pytest.approx(1.0 / POLL_S, abs=2)
    assert after.longest_stall == pytest.approx(1.0, abs=0.02)
    assert after.reconnects == 0
    # Nothing is caught up on: half a second has its fifty polls, at their distance.
    times = [at for at, _ in here.gripper.stamps[given + 1 :]]
    assert len(times) == pytest.approx(0.5 / POLL_S, abs=2)
    assert min(later - earlier for earlier, later in pairwise(times)) > POLL_S / 2


@inside(started)
async def test_one_warning_a_minute_at_most(here: World, caplog: pytest.LogCaptureFixture) -> None:
    began = here.loop.time()
    while here.loop.time() - began < 100.0:
        here.loop.hold_up(0.2)
        await asyncio.sleep(0.025)
    warnings = [each.message for each in caplog.records if "holds up the event loop" in each.message]
    assert len(warnings) == 2


@inside(world)
async def test_slow_replies_are_not_blamed_on_the_loop_alone(
    here: World, caplog: pytest.LogCaptureFixture
) -> None:
    here.server.policy = lambda frame: [(0.1, frame)]
    await here.activate_beforehand()
    await here.hand.start()
    await asyncio.sleep(1.0)
    assert here.hand.statistics.longest_stall < 0.01
    (warning,) = [each.message for each in caplog.records if LATE_POLLS in each.message]
    assert "the gripper answers slowly" in warning
    assert "event loop" not in warning


@inside(started)
@pytest.mark.parametrize("held_s", [0.05, 0.3, 0.6, 3.0])
async def test_a_move_survives(here: World, held_s: float) -> None:
    moving = asyncio.create_task(here.hand.move(200, Finger.A, speed=0))
    for _ in range(3):
        # Between two exchanges: the simulator shares the loop, and would be held up with a request
        # that a real gripper answers in that time.
        await anext(here.hand.statuses())
        here.loop.hold_up(held_s)
    result = await moving
    assert abs(result.positions[Finger.A] - 200) <= 2
    assert here.hand.statistics.reconnects == 0
    assert here.hand.statistics.foreign_commands == 0


@inside(started)
@pytest.mark.parametrize("turns", range(1, 2 * POLL_TURNS + 1))
async def test_the_link_survives_wherever_in_an_exchange_it_happens(here: World, turns: int) -> None:
    await anext(here.hand.statuses())
    here.loop.after_turns(turns, lambda: here.loop.hold_up(0.6))
    await asyncio.sleep(2.0)
    assert here.hand.statistics.longest_stall > 0.5
    assert here.hand.statistics.reconnects == 0


@inside(started)
async def test_a_silent_gripper_is_given_up_on_also_in_a_loop_that_is_held_up_again_and_again(
    here: World,
) -> None:
    async with here.server.fault_injector.making(Trouble("silence")):
        began = here.loop.time()
        while here.hand.state is not State.DISCONNECTED:
            here.loop.hold_up(0.05)
            await asyncio.sleep(0)
            assert here.loop.time() - began < 1.0


# -- events in that time are seen before anything is written -----------------------------------------------


@inside(started)
@pytest.mark.parametrize("how", ["command", "stop"])
async def test_changes_during_a_stall_are_seen_before_the_next_write(here: World, how: str) -> None:
    await here.hand.move(50, A)
    here.gripper.write(0, [0x0000])  # another client resets the gripper ...
    here.loop.hold_up(1.0)  # ... while other code holds the loop
    if how == "command":
        here.hand.command(A, position=100)
    else:
        await here.hand.stop()
    await here.nothing_moves_for(6)


@inside(started)
@pytest.mark.parametrize("turns", range(1, 2 * POLL_TURNS + 1))
async def test_a_stall_anywhere_in_a_poll_delays_the_write_until_a_new_status(
    here: World, turns: int
) -> None:
    await here.hand.move(50, A)

    def hold_up() -> None:
        here.gripper.write(0, [0x0000])
        here.loop.hold_up(1.0)
        here.hand.command(A, position=100)

    here.loop.after_turns(turns, hold_up)
    await asyncio.sleep(1.5)
    await here.nothing_moves_for(2)  # an activation takes as long
    assert not Request.from_registers(here.gripper.request_registers).activate


@inside(started)
async def test_a_gripper_is_polled_once_more_when_the_loop_is_held_up_again_during_the_second_poll(
    here: World,
) -> None:
    await here.hand.move(50, A)
    await anext(here.hand.statuses())
    here.loop.hold_up(0.3)
    here.hand.command(A, position=100)
    heard = len(here.server.heard)
    await here.until(lambda: len(here.server.heard) > heard)
    await asyncio.sleep(0.0001)
    here.loop.hold_up(0.1)
    here.gripper.write(0, [0x0000])
    here.loop.hold_up(0.2)
    await here.nothing_moves_for(6)


@inside(started)
async def test_a_release_is_called_off_when_the_gripper_was_reset_while_the_loop_was_held_up(
    here: World,
) -> None:
    await here.hand.move(100)
    here.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await here.until_state(State.FAULT)
    await asyncio.sleep(0.3)
    here.gripper.write(0, [0x0000])
    here.loop.hold_up(1.0)
    with pytest.raises(NotActivatedError):
        await here.hand.atr()
    await here.nothing_moves_for(6)


@inside(started)
async def test_a_move_cancelled_while_the_loop_was_held_up_stops_where_it_is_by_then(here: World) -> None:
    moving = asyncio.create_task(here.hand.move(255, A, speed=0))
    await asyncio.sleep(0.3)
    moving.cancel()
    here.loop.hold_up(0.5)
    at = here.gripper.position(A)
    await asyncio.sleep(2)
    assert abs(here.gripper.position(A) - at) < 10


# -- limits of time --------------------------------------------------------------------------------------


@inside(started, speedup=1.0)
@pytest.mark.parametrize("held_s", [1.0, 1.5, 10.0])
@pytest.mark.parametrize("turns", range(1, 3 * POLL_TURNS))
async def test_a_stop_is_written_wherever_in_it_the_loop_is_held_up(
    here: World, turns: int, held_s: float
) -> None:
    """When its time was over after the block, it was not even tried."""
    moving = asyncio.create_task(here.hand.close(speed=0))
    await asyncio.sleep(0.3)
    here.loop.after_turns(turns, lambda: here.loop.hold_up(held_s))
    await here.hand.stop()
    assert isinstance(await asyncio.gather(moving, return_exceptions=True), list)
    assert not here.gripper.is_moving
    assert not Request.from_registers(here.gripper.request_registers).go


@inside(started)
async def test_a_move_that_has_arrived_while_the_loop_was_held_up_has_arrived(here: World) -> None:
    """It was a MoveTimeoutError: the limit passed in that time."""
    moving = asyncio.create_task(here.hand.move(200, A))
    await asyncio.sleep(0.1)
    here.loop.hold_up(30.0)
    assert abs((await moving).positions[A] - 200) <= 2


@inside(started)
async def test_a_part_that_is_held_by_then_is_held(here: World) -> None:
    """The fingers "still moved": the limit passed before the status that shows the grip."""
    here.gripper.place_object(Finger.ABC, position=150)
    grasping = asyncio.create_task(here.hand.grasp(timeout=2.0))
    await asyncio.sleep(0.1)
    here.loop.hold_up(30.0)
    assert (await grasping).is_held


@inside(started)
@pytest.mark.parametrize("turns", range(1, POLL_TURNS))
@pytest.mark.parametrize("shows_after", [0.005, 0.3])
async def test_a_reset_that_was_done_while_the_loop_was_held_up_is_done(
    here: World, shows_after: float, turns: int
) -> None:
    """Or is seen a while later: the block may come before its write leaves."""
    here.gripper.device_cycle = shows_after * here.gripper.speedup
    here.loop.after_turns(turns, lambda: here.loop.hold_up(6.0))
    await here.hand.reset()
    assert here.hand.state is State.RESET


@inside(world)
@pytest.mark.parametrize("turns", range(1, 3 * POLL_TURNS))
async def test_a_start_outlasts_a_loop_that_is_held_up(here: World, turns: int) -> None:
    """It was a ConnectFailedError: no connection within 2 s."""
    await here.activate_beforehand()
    here.loop.after_turns(turns, lambda: here.loop.hold_up(2.5))
    await here.hand.start()


@inside(world)
@pytest.mark.parametrize("turns", range(1, POLL_TURNS + 1))
async def test_an_activation_that_has_begun_while_the_loop_was_held_up_makes_progress(
    here: World, turns: int
) -> None:
    """A status from before the block, read after it, counted as 5 s without anything new."""
    here.gripper.device_cycle = 0.2 * here.gripper.speedup
    await here.hand.start(activate=False)
    activating = asyncio.create_task(here.hand.activate())
    await asyncio.sleep(0.1)
    here.loop.after_turns(turns, lambda: here.loop.hold_up(6.0))
    await activating
    assert here.hand.state is State.RUNNING_IDLE


# -- a loop that is not run, as between the prompts of IPython's terminal ---------------------------------


@pytest.mark.parametrize("kind", ["asyncio", "uvloop"])
def test_a_loop_that_was_not_running_is_late_and_goes_on(kind: str, caplog: pytest.LogCaptureFixture) -> None:
    factory = pytest.importorskip(kind).new_event_loop
    with asyncio.Runner(loop_factory=factory) as runner:
        hand = RobotiqHand("sim://?speedup=100")
        runner.run(hand.start())
        runner.run(hand.move(100, A, speed=255))
        for _ in range(3):  # prompts that are answered at once
            runner.run(asyncio.sleep(0.01))
        is_busy = bool(caplog.messages)  # a machine that is late by itself, and there is one warning a minute
        time.sleep(0.2)  # nothing is waited for: the test is that the loop does not run
        runner.run(asyncio.sleep(0.02))
        (warning,) = caplog.messages
        assert is_busy or "it was not running" in warning
        assert "robotiq_async.sync" not in warning, "a hint for IPython alone"
        stall = hand.statistics.longest_stall
        assert 0.15 < stall < 0.6
        # It continues as if nothing had been.
        assert hand.state is State.RUNNING_IDLE
        assert runner.run(hand.move(200, A)).positions[A] == pytest.approx(200, abs=3)
        assert hand.statistics.reconnects == 0
        runner.run(hand.stop())
