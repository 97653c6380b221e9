"""Goals on a hand, without ROS: what ends them, and what the axes do then."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator
from typing import Any

import pytest

from robotiq_async import HAND_E, TWO_FINGER_85, ConnectionLostError, Finger, MoveResult, RobotiqHand, State
from robotiq_async.hand import Hand
from robotiq_async.ros2.gripper.connection import make_hand
from robotiq_async.ros2.gripper.goals import Ending, GoalRunner, Outcome
from robotiq_async.ros2.translation.diagnosis import is_connected, why_not
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.values.request import Request
from tests.fake_hand import FakeHand
from tests.grippers import active_gripper

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR
CLOSE = Targets(((240, Finger.ABC),))
USUAL = {name: parameter.default for name, parameter in PARAMETERS.items()}


@pytest.fixture
async def slow() -> AsyncIterator[RobotiqHand]:
    """A hand at a gripper that takes half a second to close."""
    async with (
        SimulatorServer(active_gripper(spread=False, device_cycle=0.02)) as server,
        RobotiqHand(server.address) as hand,
    ):
        yield hand


def begin(
    runner: GoalRunner, targets: Targets = CLOSE, key: bytes = b"1", *, allow_stalling: bool = True
) -> asyncio.Task[Outcome]:
    return asyncio.create_task(runner.run(key, targets, speed=255, force=64, allow_stalling=allow_stalling))


async def until_moving(hand: RobotiqHand, axes: Finger = Finger.A) -> None:
    async for status in hand.statuses():
        if axes in status.moving:
            return


async def test_a_goal_for_several_positions_is_one_write(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    before = len(gripper.writes)
    outcome = await begin(GoalRunner(hand), Targets(((50, A), (80, B | C), (140, S))))
    reason = "every axis reached its target"
    assert outcome == Outcome(Ending.SUCCEEDED, stalled=False, reached=True, reason=reason)
    assert [gripper.position(axis) for axis in (A, B, C, S)] == [50, 80, 80, 140]
    assert len(gripper.writes) == before + 1
    assert [axis.speed for axis in Request.from_registers(gripper.writes[-1].registers).axes] == [255] * 4


@pytest.mark.parametrize(("allow", "ending"), [(True, Ending.SUCCEEDED), (False, Ending.ABORTED)])
async def test_a_contact(hand: RobotiqHand, gripper: SimulatedGripper, allow: bool, ending: Ending) -> None:
    gripper.place_object(A, position=100)
    outcome = await begin(GoalRunner(hand), allow_stalling=allow)
    assert outcome == Outcome(ending, stalled=True, reached=False, reason="contact: A")


async def test_a_canceled_goal_ends_when_its_axes_have_been_told_to_stay(slow: RobotiqHand) -> None:
    runner = GoalRunner(slow)
    goal = begin(runner)
    await until_moving(slow)
    runner.cancel(b"1")
    outcome = await goal
    assert outcome.ending is Ending.CANCELED
    there = slow.status.position(A)
    assert there < 200
    while slow.is_moving:
        await anext(slow.statuses())
    assert abs(slow.status.position(A) - there) <= 3


async def test_a_canceled_goal_does_not_hold_what_the_next_one_moves(slow: RobotiqHand) -> None:
    runner = GoalRunner(slow)
    first = begin(runner)
    await until_moving(slow)
    runner.cancel(b"1")
    second = begin(runner, Targets(((230, Finger.ABC),)), b"2")
    assert (await first).ending is Ending.CANCELED
    assert (await second).ending is Ending.SUCCEEDED
    assert slow.status.position(A) >= 228


class DeafHand(FakeHand):
    """Its gripper moves for ever, and takes no hold."""

    async def _move(self, axes: Finger, target: int, *_: Any) -> MoveResult:
        self.command(axes, position=target)
        await asyncio.Event().wait()
        raise AssertionError

    async def _hold(self, axes: Finger) -> None:  # noqa: ARG002
        raise ConnectionLostError("the link went down")


async def test_a_hold_that_is_not_acknowledged_is_told(caplog: pytest.LogCaptureFixture) -> None:
    async with DeafHand() as hand:
        runner = GoalRunner(hand)
        requests = hand.requests()
        goal = begin(runner)
        await anext(requests)
        runner.cancel(b"1")
        with caplog.at_level(logging.ERROR, "robotiq_async"):
            outcome = await goal
    assert outcome.ending is Ending.ABORTED, "canceled would say that the axes are to stay"
    assert outcome.reason == "canceled by its client, but the hold was not acknowledged: the link went down"
    assert "the hold was not acknowledged: the link went down" in caplog.text


async def test_the_key_of_another_goal_cancels_nothing(hand: RobotiqHand) -> None:
    runner = GoalRunner(hand)
    goal = begin(runner)
    runner.cancel(b"2")
    assert (await goal).ending is Ending.SUCCEEDED
    runner.cancel(b"1")  # over already
    runner.abort("over already")


async def test_a_new_goal_holds_the_axes_that_it_does_not_address(slow: RobotiqHand) -> None:
    runner = GoalRunner(slow)
    first = begin(runner)
    await until_moving(slow)
    second = begin(runner, Targets(((60, A),)), b"2")
    outcome = await first
    assert (outcome.ending, outcome.reason) == (Ending.ABORTED, "another goal took over")
    assert (await second).ending is Ending.SUCCEEDED
    assert abs(slow.status.position(A) - 60) <= 2
    assert slow.status.position(B) < 200
    assert not slow.is_moving


async def test_of_many_goals_at_once_the_last_one_runs(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    runner = GoalRunner(hand)
    goals = [begin(runner, Targets(((20 * n, A),)), bytes([n])) for n in range(1, 6)]
    *others, last = await asyncio.gather(*goals)
    assert {outcome.ending for outcome in others} == {Ending.ABORTED}
    assert last.ending is Ending.SUCCEEDED
    assert gripper.position(A) == 100


async def test_a_goal_that_is_canceled_before_it_could_begin_moves_nothing(
    hand: RobotiqHand, gripper: SimulatedGripper
) -> None:
    runner = GoalRunner(hand)
    first, second = begin(runner), begin(runner, Targets(((99, S),)), b"2")
    await asyncio.sleep(0)
    runner.cancel(b"2")
    assert [(await goal).ending for goal in (first, second)] == [Ending.ABORTED, Ending.CANCELED]
    assert all(Request.from_registers(write.registers).position(S) != 99 for write in gripper.writes)


async def test_a_deactivation_aborts(slow: RobotiqHand) -> None:
    runner = GoalRunner(slow)
    goal = begin(runner)
    await until_moving(slow)
    runner.abort("the node was deactivated")
    assert await goal == Outcome(
        Ending.ABORTED, stalled=False, reached=False, reason="the node was deactivated"
    )


async def test_a_halt_aborts(slow: RobotiqHand) -> None:
    goal = begin(GoalRunner(slow))
    await until_moving(slow)
    await slow.halt()
    outcome = await goal
    assert outcome.ending is Ending.ABORTED
    assert "halt" in outcome.reason


async def test_a_lost_link_aborts(server: SimulatorServer, hand: RobotiqHand) -> None:
    goal = begin(GoalRunner(hand))
    await until_moving(hand)
    server.refuse()
    server.cut()
    assert (await goal).ending is Ending.ABORTED
    assert why_not(hand) == "the link to the gripper is down"
    await server.accept()
    await hand.wait_for_state(State.RUNNING_IDLE, timeout=5)
    assert why_not(hand) is None


async def test_feedback_comes_while_a_goal_is_under_way(slow: RobotiqHand) -> None:
    seen: list[int] = []
    await GoalRunner(slow).run(
        b"1",
        CLOSE,
        speed=255,
        force=64,
        allow_stalling=True,
        feedback=lambda: seen.append(slow.status.position(A)),
    )
    assert 5 <= len(seen) <= 12  # in about half a second
    assert seen == sorted(seen)


async def test_any_hand_will_do() -> None:
    hand: Hand = FakeHand()
    async with hand:
        assert (await begin(GoalRunner(hand))).ending is Ending.SUCCEEDED


# -- which hand, and why not ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("address", "shown"), [("192.168.1.11", "tcp://192.168.1.11:502"), ("zenoh://lab/cell/left",) * 2]
)
def test_the_address_says_which_hand(address: str, shown: str) -> None:
    assert make_hand(check_settings(USUAL | {"address": address})).address == shown


def test_the_model_is_a_parameter_or_in_the_address() -> None:
    assert make_hand(check_settings(USUAL | {"model": "Hand-E"})).model is HAND_E
    there = USUAL | {"address": "sim://?model=2f85"}
    assert make_hand(check_settings(there | {"model": "2f85"})).model is TWO_FINGER_85
    with pytest.raises(ValueError, match="model hand-e contradicts the address"):
        make_hand(check_settings(there | {"model": "hand-e"}))


async def test_why_no_goal_is_taken(server: SimulatorServer, gripper: SimulatedGripper) -> None:
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
