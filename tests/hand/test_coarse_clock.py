"""A hand where the clock counts in steps of 15.6 ms, as on Windows before Python 3.13."""

from __future__ import annotations

import asyncio
import math
from collections.abc import Awaitable, Callable

import pytest

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.grippers import activate_beforehand
from tests.virtual import VirtualLoop

STEP_S = 1 / 64
LOOK_S = 1e-6
"""Seconds for a look at the clock, so that a busy wait does not wait for ever."""


class CoarseLoop(VirtualLoop):
    """Its time stands still between the steps; the gripper's runs on."""

    def __init__(self) -> None:
        super().__init__()
        self._clock_resolution = STEP_S
        self.exact = super().time

    def time(self) -> float:
        self._virtual.now += LOOK_S
        return math.floor(super().time() / STEP_S) * STEP_S


def coarsely(story: Callable[[CoarseLoop, RobotiqHand, SimulatedGripper], Awaitable[None]]) -> None:
    """Tell a story of an active hand."""

    async def main(loop: CoarseLoop) -> None:
        gripper = SimulatedGripper(loop.exact, spread=False)
        await activate_beforehand(gripper)
        async with SimulatorServer(gripper) as server:
            hand = RobotiqHand(server.address)
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


def test_there_is_a_poll_a_step_and_no_busy_waiting_between_them() -> None:
    async def story(loop: CoarseLoop, hand: RobotiqHand, gripper: SimulatedGripper) -> None:
        polls, turns, began = hand.statistics.polls, loop.turns, loop.exact()
        await asyncio.sleep(2.0)
        steps = (loop.exact() - began) / STEP_S
        assert hand.statistics.polls - polls == pytest.approx(steps, rel=0.1)
        assert loop.turns - turns < 20 * steps
        assert hand.statistics.overruns > 0, "the other polls are counted as missed"

    coarsely(story)
