"""A hand where the clock counts in steps of 15.6 ms, as on Windows before Python 3.13."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable
from typing import Any

import pytest

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.hands.options import LATE_POLLS
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop

STEP_S = 1 / 64
LOOK_S = 1e-6
"""Seconds for a look at the clock, so that a busy wait does not wait for ever."""


class CoarseLoop(VirtualLoop):
    """Its time stands still between the steps, and is cut to milliseconds; the gripper's runs on."""

    def __init__(self) -> None:
        super().__init__()
        self._clock_resolution = STEP_S
        self.exact = super().time

    def time(self) -> float:
        self._virtual.now += LOOK_S
        return math.floor(1000 * math.floor(super().time() / STEP_S) * STEP_S) / 1000


def coarsely(
    story: Callable[[CoarseLoop, RobotiqHand, SimulatedGripper], Awaitable[None]], **options: Any
) -> None:
    """Tell a story of an active hand."""

    async def main(loop: CoarseLoop) -> None:
        gripper = SimulatedGripper(loop.exact, spread=False)
        await activate_beforehand(gripper)
        async with SimulatorServer(gripper) as server:
            hand = RobotiqHand(server.address, **options)
            await hand.start()
            await story(loop, hand, gripper)
            await hand.stop()
            assert hand.state is State.SHUTDOWN

    with asyncio.Runner(loop_factory=CoarseLoop) as runner:
        loop = runner.get_loop()
        assert isinstance(loop, CoarseLoop)
        loop.end_after(60.0)
        runner.run(main(loop))
        assert loop.complaints == []


def test_moves_and_grips_end_where_they_should() -> None:
    async def story(loop: CoarseLoop, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
        began = loop.exact()
        result = await hand.move(200, speed=255)
        assert all(abs(position - 200) <= 2 for position in result.positions.values())
        assert result.duration == pytest.approx(loop.exact() - began, abs=2 * STEP_S)
        await hand.open()
        gripper.place_object(Finger.ABC, 150)
        assert (await hand.close(speed=255)).contacts == Finger.ABC

    coarsely(story)


def test_a_halt_stops_the_fingers_within_some_steps() -> None:
    async def story(loop: CoarseLoop, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
        moving = asyncio.create_task(hand.move(255, speed=0))
        await asyncio.sleep(0.2)
        began = loop.exact()
        await hand.halt()
        assert loop.exact() - began < 10 * STEP_S
        with pytest.raises(Exception, match="a halt stopped the fingers"):
            await moving
        travelled = gripper.travel(Finger.A)
        await asyncio.sleep(0.5)
        assert gripper.travel(Finger.A) - travelled <= 2

    coarsely(story)


@pytest.mark.parametrize("interval", [0.005, 0.0156, 0.016])
def test_the_interval_is_what_the_clock_can_tell_and_no_poll_counts_as_missed(interval: float) -> None:
    async def story(loop: CoarseLoop, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
        before, turns, began = hand.statistics, loop.turns, loop.exact()
        await hand.move(255, speed=255)
        await asyncio.sleep(6.0)
        steps, after = (loop.exact() - began) / STEP_S, hand.statistics
        assert after.polls - before.polls == pytest.approx(steps / 1.1, rel=0.01)
        assert loop.turns - turns < 20 * steps, "it waits between the polls"
        assert after.overruns == 0
        assert after.longest_stall < 0.002

    coarsely(story, poll_interval=interval)


def test_a_loop_that_is_held_up_is_noticed_all_the_same(caplog: pytest.LogCaptureFixture) -> None:
    async def story(loop: CoarseLoop, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
        await asyncio.sleep(0.5)
        assert LATE_POLLS not in caplog.text
        loop.hold_up(0.2)
        await asyncio.sleep(0.5)
        figures = hand.statistics
        # The tick that comes after it is none of those that were missed.
        assert figures.overruns == pytest.approx(0.2 / STEP_S / 1.1 - 1, abs=1)
        assert figures.longest_stall == pytest.approx(0.2, abs=2 * STEP_S)

    coarsely(story)
    assert LATE_POLLS in caplog.text
