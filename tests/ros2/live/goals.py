"""Goals from another process: each way to end, and each way to be refused."""

from __future__ import annotations

import json
import math
import signal
from collections.abc import Sequence

import pytest

from robotiq_async import Fault, Finger
from robotiq_async.ros2.translation.joints import joint_names
from tests.ros2.live.bench import ABORTED, CANCELED, SUCCEEDED, Goal, waited
from tests.ros2.live.fixtures import Cell
from tests.ros2.live.processes import Process
from tests.ros2.live.simulated import Simulator

A = Finger.A
STATES = joint_names()


def position(simulator: Simulator, axis: Finger = A) -> int:
    return int(simulator.do("position", axis))


def begun(goal: Goal) -> Goal:
    """Fingers are seen to move."""
    first = goal.feedback.wait(new=False).state.position[-3]
    goal.feedback.wait(lambda it: it.state.position[-3] > first + 0.05, new=False)
    return goal


def test_a_goal_ends_where_it_was_sent(cell: Cell) -> None:
    goal = cell.client.move(math.radians(35))
    status, result = goal.ends()
    assert status == SUCCEEDED
    assert result.reached_goal
    assert not result.stalled
    assert list(result.state.name) == STATES
    assert result.state.position[STATES.index("finger_1_joint_1")] == pytest.approx(math.radians(35))
    assert position(cell.simulator) == 70


def test_joints_of_their_own(cell: Cell) -> None:
    names = ["finger_1_joint_1", "finger_2_joint_2", "finger_middle_joint_1", "palm_finger_1_joint"]
    status, _ = cell.client.move(math.radians(20), math.radians(45), 0.0, 0.0, names=names).ends()
    assert status == SUCCEEDED
    axes = (Finger.C, Finger.B, Finger.A, Finger.SCISSOR)
    assert [position(cell.simulator, axis) for axis in axes] == pytest.approx([40, 190, 6, 128], abs=1)


def test_one_angle_without_a_name_closes_all_fingers_and_is_fed_back(cell: Cell) -> None:
    goal = cell.client.move(2.8, names=())
    assert goal.ends()[0] == SUCCEEDED
    assert position(cell.simulator) >= 238
    angles = [it.state.position[-3] for it in goal.feedback.messages]
    assert len(angles) >= 5
    assert angles == sorted(angles)


def test_a_contact_is_a_grasp(cell: Cell) -> None:
    cell.simulator.do("place_object", A, position=100)
    status, result = cell.client.move(2.8).ends()
    assert status == SUCCEEDED
    assert result.stalled
    assert not result.reached_goal
    assert abs(position(cell.simulator) - 100) <= 2
    cell.client.move(0.0).ends()
    assert cell.client.set("allow_stalling", False).successful
    status, result = cell.client.move(2.8).ends()
    assert (status, result.stalled) == (ABORTED, True)


def test_cancel_stops_the_fingers(cell: Cell) -> None:
    goal = begun(cell.client.move(2.8))
    goal.cancel()
    status, result = goal.ends()
    there = position(cell.simulator)
    assert status == CANCELED
    assert not result.reached_goal
    assert there < 200
    states = cell.client.joint_states()
    for _ in range(10):
        states.wait()
    assert abs(position(cell.simulator) - there) <= 3, "a held axis may come back by a count or two"


def test_a_cancel_that_comes_while_a_goal_is_being_accepted(cell: Cell) -> None:
    """Goals and cancels as fast as they can be sent: a goal that is being cancelled has not arrived."""
    waited(cell.client.cancel_all())  # the service is known from here on
    for _ in range(5):
        accepting, feedback = cell.client.begin_goal(["fingers"], [2.8])
        canceling = cell.client.cancel_all()
        goal = Goal(cell.client, waited(accepting), feedback)
        if not waited(canceling).goals_canceling:  # it came before the goal
            goal.cancel()
        assert goal.ends()[0] == CANCELED
    assert position(cell.simulator) < 200


def test_a_new_goal_takes_over(cell: Cell) -> None:
    first = begun(cell.client.move(2.8))
    second = cell.client.move(math.radians(10), names=["finger_middle_joint_1"])
    assert first.ends()[0] == ABORTED
    assert second.ends()[0] == SUCCEEDED
    assert position(cell.simulator) == 20
    assert position(cell.simulator, Finger.B) < 200, "what the new goal does not address is held"
    cell.node.prints("goal aborted: another goal took over")


def test_speed_and_force_of_a_goal_are_parameters(cell: Cell) -> None:
    assert cell.client.set("speed", 7).successful
    assert cell.client.set("force", 9).successful
    try:
        goal = cell.client.send(["fingers"], [0.5], velocity=[1.0], effort=[2.0])
        assert goal is not None
        begun(goal).cancel()
        goal.ends()
        image = cell.simulator.read("request_registers")
        assert bytes(half for word in image for half in divmod(word, 256))[4:6] == bytes([7, 9])
        cell.node.prints("velocity and effort in goals are ignored")
    finally:
        cell.client.set("speed", 128)
        cell.client.set("force", 64)


@pytest.mark.parametrize(
    ("names", "positions", "reason"),
    [
        (["fingers"], [math.nan], "the position of 'fingers' is nan"),
        (["fingers"], [3.0], "'fingers' must be in 0..2.8 rad, got 3.0000"),
        ([], [], "no joint is named"),
    ],
)
def test_bad_goals_are_refused_with_a_reason(
    cell: Cell, names: Sequence[str], positions: Sequence[float], reason: str
) -> None:
    writes = len(cell.simulator.read("writes"))
    assert cell.client.send(names, positions) is None
    cell.node.prints(f"goal rejected: {reason}")
    assert len(cell.simulator.read("writes")) == writes
    assert cell.client.move(0.0).ends()[0] == SUCCEEDED, "the node lives on"


def test_a_fault_refuses_goals_until_recover(cell: Cell) -> None:
    goal = begun(cell.client.move(2.8))
    cell.simulator.do("inject_fault", Fault.SCISSOR_BLOCKED)
    assert goal.ends()[0] == ABORTED
    assert cell.client.send(["fingers"], [0.0]) is None
    cell.node.prints("goal rejected: the gripper is in fault 0x0E")
    answer = cell.client.call("recover")
    assert answer.success, answer.message
    assert cell.client.move(0.0).ends()[0] == SUCCEEDED


def test_reset_and_activate(cell: Cell) -> None:
    assert cell.client.call("reset").success
    assert cell.client.send(["fingers"], [0.0]) is None
    cell.node.prints("goal rejected: the gripper is not activated: call ~/activate")
    assert cell.client.call("activate").success
    assert not cell.client.call("release").success, "only in a fault"


def test_halt_does_not_wait_for_an_activation(cell: Cell) -> None:
    cell.client.call("reset")
    activation = cell.client.begin("activate")
    cell.client.status().wait(lambda it: json.loads(it.data)["state"] == "WF_ACTIVATION", new=False)
    answer = cell.client.call("halt")
    assert "the gripper is reset" in answer.message
    assert not activation.done() or not activation.result().success
    assert cell.client.call("activate").success


def test_calls_without_waiting_for_an_answer(cell: Cell) -> None:
    """The middleware loses some of them, the oldest first; the node stands it."""
    goal = begun(cell.client.move(2.8))
    for _ in range(300):
        cell.client.begin("halt")
    assert cell.client.call("halt").success
    assert goal.ends()[0] == ABORTED
    assert cell.client.move(0.0).ends()[0] == SUCCEEDED


def test_the_goal_of_a_killed_client_goes_on_to_its_end(cell: Cell) -> None:
    with Process("-m", "tests.ros2.live.client", "goal", "2.8") as other:
        other.prints("under way")
        other.send(signal.SIGKILL)
        assert other.ends() == -signal.SIGKILL
    states = cell.client.joint_states()
    states.wait(lambda it: it.position[STATES.index("finger_1_joint_2")] > 1.5, new=False)
    assert cell.client.move(0.0).ends()[0] == SUCCEEDED, "the node lives on"


def test_a_client_that_hammers_does_not_keep_out_another_one(cell: Cell) -> None:
    before = figures(cell)
    with Process("-m", "tests.ros2.live.client", "hammer", "halt", "500") as other:
        other.prints("begun")
        assert cell.client.call("halt").success
        assert cell.client.send(["fingers"], [math.nan]) is None
        other.prints("500 answers in")
        assert other.ends() == 0
    after = figures(cell)
    assert after["reconnects"] == before["reconnects"]
    assert cell.client.move(0.0).ends()[0] == SUCCEEDED


def figures(cell: Cell) -> dict[str, str]:
    """Figures of the polling, from the node."""
    link, _ = cell.client.diagnostics().wait().status
    return {each.key: each.value for each in link.values}
