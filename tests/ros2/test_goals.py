"""Goals on a hand, without ROS: what ends them, and what the axes do then."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from typing import Any

import pytest

from robotiq_async import HAND_E, TWO_FINGER_85, ConnectionLostError, Finger, MoveResult, RobotiqHand, State
from robotiq_async.ros2.gripper.connection import make_hand
from robotiq_async.ros2.gripper.goals import GoalEnding, GoalOutcome, GoalRunner
from robotiq_async.ros2.translation.diagnosis import is_connected, why_not
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import Request
from tests.fake_hand import FakeBackend, FakeHand
from tests.grippers import activate_beforehand, shows

pytestmark = pytest.mark.virtual_time

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR
CLOSE = Targets(((240, Finger.ABC),))
USUAL = {name: parameter.default for name, parameter in PARAMETERS.items()}


@pytest.fixture
async def gripper() -> SimulatedGripper:
    """One that is active and takes two seconds to close."""
    gripper = SimulatedGripper(asyncio.get_running_loop().time, spread=False)
    await activate_beforehand(gripper)
    return gripper


@pytest.fixture
async def hand(server: SimulatorServer) -> AsyncIterator[RobotiqHand]:
    async with RobotiqHand(server.address) as hand:
        yield hand


def begin(
    runner: GoalRunner, targets: Targets = CLOSE, key: bytes = b"1", **options: Any
) -> asyncio.Task[GoalOutcome]:
    options = {"speed": 255, "force": 64, "allow_stalling": True} | options
    return asyncio.create_task(runner.run(key, targets, **options))


async def moving(hand: RobotiqHand) -> tuple[GoalRunner, asyncio.Task[GoalOutcome]]:
    """A goal that closes the fingers, which have begun to move."""
    runner = GoalRunner(hand)
    goal = begin(runner)
    await shows(hand, lambda status: A in status.moving)
    return runner, goal


async def test_a_goal_for_several_positions_is_one_write(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    before = len(gripper.writes)
    outcome = await begin(GoalRunner(hand), Targets(((50, A), (80, B | C), (140, S))))
    reason = "every axis reached its target"
    assert outcome == GoalOutcome(GoalEnding.SUCCEEDED, stalled=False, reached=True, reason=reason)
    assert [gripper.position(axis) for axis in (A, B, C, S)] == [50, 80, 80, 140]
    assert len(gripper.writes) == before + 1
    axes = Request.from_registers(gripper.writes[-1].registers).axes
    assert [(axis.speed, axis.force) for axis in axes] == [(255, 64)] * 4


@pytest.mark.parametrize(("allow", "ending"), [(True, GoalEnding.SUCCEEDED), (False, GoalEnding.ABORTED)])
async def test_a_contact(
    hand: RobotiqHand, gripper: SimulatedGripper, allow: bool, ending: GoalEnding
) -> None:
    gripper.place_object(A, position=100)
    outcome = await begin(GoalRunner(hand), allow_stalling=allow)
    assert outcome == GoalOutcome(ending, stalled=True, reached=False, reason="contact: A")


async def test_a_canceled_goal_holds_its_axes_where_they_are(hand: RobotiqHand) -> None:
    runner, goal = await moving(hand)
    runner.cancel(b"2")  # another goal's key
    await asyncio.sleep(0.1)
    assert not goal.done()
    runner.cancel(b"1")
    assert (await goal).ending is GoalEnding.CANCELED
    there = hand.status.position(A)
    await asyncio.sleep(1)
    assert abs(hand.status.position(A) - there) <= 3
    runner.cancel(b"1")  # over already
    runner.abort("over already")


async def test_a_canceled_goal_does_not_hold_what_the_next_one_moves(hand: RobotiqHand) -> None:
    runner, first = await moving(hand)
    runner.cancel(b"1")
    second = begin(runner, Targets(((230, Finger.ABC),)), b"2")
    assert (await first).ending is GoalEnding.CANCELED
    assert (await second).ending is GoalEnding.SUCCEEDED
    assert hand.status.position(A) >= 228


class DeafBackend(FakeBackend):
    """Its gripper moves for ever, and takes no hold."""

    async def move(self, axes: Finger, target: int, *_: Any) -> MoveResult:
        self.command(axes, target, None, None)
        await asyncio.Event().wait()
        raise AssertionError

    async def hold(self, axes: Finger) -> None:  # noqa: ARG002
        raise ConnectionLostError("the link went down")


async def test_a_hold_that_is_not_acknowledged_aborts_the_goal(caplog: pytest.LogCaptureFixture) -> None:
    async with FakeHand(kind=DeafBackend) as hand:
        runner, requests = GoalRunner(hand), hand.requests()
        goal = begin(runner)
        await anext(requests)
        runner.cancel(b"1")
        with caplog.at_level(logging.ERROR, "robotiq_async"):
            outcome = await goal
    assert outcome.ending is GoalEnding.ABORTED, "canceled would say that the axes are to stay"
    assert outcome.reason == "canceled by its client, but the hold was not acknowledged: the link went down"
    assert "the hold was not acknowledged: the link went down" in caplog.text


class LingeringBackend(FakeBackend):
    """A move that is cancelled takes a second to end."""

    async def move(self, axes: Finger, target: int, *_: Any) -> MoveResult:
        self.command(axes, target, None, None)
        try:
            await asyncio.Event().wait()
        finally:
            await asyncio.sleep(1)
        raise AssertionError


async def test_a_goal_that_is_given_up_while_it_waits_keeps_none_waiting() -> None:
    """The next one waited for it for ever."""
    loop = asyncio.get_running_loop()
    async with FakeHand(kind=LingeringBackend) as hand:
        runner, requests = GoalRunner(hand), hand.requests()
        first = begin(runner)
        await anext(requests)
        second = begin(runner, key=b"2")
        await asyncio.sleep(0.1)
        began = loop.time()
        second.cancel()
        third = begin(runner, key=b"3")
        async with asyncio.timeout(5):
            await anext(requests)
            assert loop.time() - began > 0.8, "the axes of the first one are free then"
            runner.abort("the end")
            assert [(await each).ending for each in (first, third)] == [GoalEnding.ABORTED] * 2
        assert second.cancelled()


async def test_a_new_goal_holds_the_axes_that_it_does_not_address(hand: RobotiqHand) -> None:
    runner, first = await moving(hand)
    second = begin(runner, Targets(((60, A),)), b"2")
    outcome = await first
    assert (outcome.ending, outcome.reason) == (GoalEnding.ABORTED, "another goal took over")
    assert (await second).ending is GoalEnding.SUCCEEDED
    assert abs(hand.status.position(A) - 60) <= 2
    assert hand.status.position(B) < 200
    assert not hand.is_moving


async def test_of_many_goals_at_once_the_last_one_runs(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    runner = GoalRunner(hand)
    goals = [begin(runner, Targets(((20 * n, A),)), bytes([n])) for n in range(1, 6)]
    *others, last = await asyncio.gather(*goals)
    assert {outcome.ending for outcome in others} == {GoalEnding.ABORTED}
    assert last.ending is GoalEnding.SUCCEEDED
    assert gripper.position(A) == 100


async def test_a_goal_that_is_canceled_before_it_could_begin_moves_nothing(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    runner = GoalRunner(hand)
    first, second = begin(runner), begin(runner, Targets(((99, S),)), b"2")
    await asyncio.sleep(0)
    runner.cancel(b"2")
    assert [(await goal).ending for goal in (first, second)] == [GoalEnding.ABORTED, GoalEnding.CANCELED]
    assert all(Request.from_registers(write.registers).position(S) != 99 for write in gripper.writes)


async def test_a_deactivation_and_a_halt_abort(hand: RobotiqHand) -> None:
    runner, goal = await moving(hand)
    runner.abort("the node was deactivated")
    reason = "the node was deactivated"
    assert await goal == GoalOutcome(GoalEnding.ABORTED, stalled=False, reached=False, reason=reason)
    await hand.move(0)
    _, goal = await moving(hand)
    await hand.halt()
    outcome = await goal
    assert outcome.ending is GoalEnding.ABORTED
    assert "halt" in outcome.reason


async def test_feedback_comes_twenty_times_a_second(hand: RobotiqHand) -> None:
    seen: list[int] = []
    began = asyncio.get_running_loop().time()
    await begin(GoalRunner(hand), feedback=lambda: seen.append(hand.status.position(A)))
    assert len(seen) == pytest.approx(20 * (asyncio.get_running_loop().time() - began), abs=2)
    assert seen == sorted(seen)


# -- which hand, and why not ------------------------------------------------------------------------------


def test_address_and_model_select_the_hand() -> None:
    for address, shown in (
        ("192.168.1.11", "tcp://192.168.1.11:502"),
        ("zenoh://lab/cell/left", "zenoh://lab/cell/left"),
    ):
        assert make_hand(check_settings(USUAL | {"address": address})).address == shown
    assert make_hand(check_settings(USUAL | {"model": "Hand-E"})).model is HAND_E
    assert make_hand(check_settings(USUAL | {"address": "sim://?model=2f85"})).model is TWO_FINGER_85


async def test_why_no_goal_is_taken(server: SimulatorServer, gripper: SimulatedGripper) -> None:
    gripper.power_cycle()
    hand = RobotiqHand(server.address)
    assert not is_connected(hand)
    assert why_not(hand) == "the link to the gripper is down"
    await hand.start(activate=False)
    try:
        assert "not activated: call ~/activate" in str(why_not(hand))
        activation = asyncio.create_task(hand.activate())
        await hand.wait_for_state(State.WF_ACTIVATION)
        assert "is under way (WF_ACTIVATION)" in str(why_not(hand))
        await activation
        assert why_not(hand) is None
        gripper.inject_fault(0x0E)
        await hand.wait_for_state(State.FAULT, timeout=5)
        assert "0x0E, interference on the scissor for more than 20 s: call ~/recover" in str(why_not(hand))
    finally:
        await hand.stop()
    assert not is_connected(hand)
