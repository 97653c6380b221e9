"""Joints and counts: no ROS is needed here."""

from __future__ import annotations

import math
from collections.abc import Sequence

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import HAND_E, JAW, TWO_FINGER_85, TWO_FINGER_140, Finger, Model, RobotiqStatus
from robotiq_async.ros2.translation.joints import (
    JOINT_LIMITS,
    GoalError,
    Motion,
    joint_names,
    positions,
    targets,
)
from robotiq_async.tools.description import hand_model
from robotiq_async.tools.description.kinematics import JOINTS, joint_angles
from tests.register_words import status_of

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def reading(a: int = 6, b: int = 6, c: int = 6, scissor: int = 137, *, at: float = 0.0) -> RobotiqStatus:
    return status_of(0x31, position=(a, b, c, scissor), at=at)


byte = st.integers(0, 255)


# -- joint states ------------------------------------------------------------------------------------------


def test_the_names_stand_behind_the_prefix() -> None:
    assert joint_names() == list(JOINTS)
    assert joint_names("left_")[0] == "left_palm_finger_1_joint"
    assert len(set(joint_names("left_"))) == 11


@given(byte, byte, byte, byte)
def test_every_joint_is_inside_its_limits(a: int, b: int, c: int, scissor: int) -> None:
    for name, angle in zip(JOINTS, positions(reading(a, b, c, scissor)), strict=True):
        low, high = JOINT_LIMITS[name]
        assert low <= angle <= high, name


OF_ROS = {"_joint_1": (0.0495, 1.2218), "_joint_2": (0.0, 1.5708), "_joint_3": (-1.2217, -0.0523)} | {
    "palm_finger_1_joint": (-0.1784, 0.1920),
    "palm_finger_2_joint": (-0.1920, 0.1784),
}
"""The limits of the URDF that ROS users have."""


def test_the_limits_are_inside_those_of_both_urdfs() -> None:
    packaged = {joint.name: (joint.lower, joint.upper) for joint in hand_model().moving}
    assert packaged.keys() == JOINT_LIMITS.keys()
    for name, (low, high) in JOINT_LIMITS.items():
        (theirs,) = (limits for end, limits in OF_ROS.items() if name.endswith(end))
        for least, most in (packaged[name], theirs):
            assert least <= low < high <= most, name


@given(st.integers(6, 255), st.integers(15, 232))
def test_angles_within_range_are_not_changed(finger: int, scissor: int) -> None:
    status = reading(finger, finger, finger, scissor)
    assert positions(status) == pytest.approx(joint_angles(status), abs=1e-4)


def test_a_limit_says_where_it_bites() -> None:
    base, palm = JOINTS.index("finger_1_joint_1"), JOINTS.index("palm_finger_1_joint")
    assert joint_angles(reading(c=5))[base] < positions(reading(c=5))[base] == 0.0495
    assert joint_angles(reading(scissor=240))[palm] < positions(reading(scissor=240))[palm] == -0.1784


def test_velocities_are_taken_over_some_time() -> None:
    motion = Motion()
    assert motion.of(reading(at=0.0)) == (positions(reading()), (0.0,) * 11)
    base = JOINTS.index("finger_middle_joint_1")
    for step in range(1, 20):
        _, velocities = motion.of(reading(a=6 + step, at=step * 0.01))
        assert velocities[base] == pytest.approx(math.radians(0.5) / 0.01)
    assert motion.of(reading(a=25, at=0.19))[1][base] == pytest.approx(math.radians(0.5) / 0.01)
    for step in range(20, 25):
        motion.of(reading(a=25, at=step * 0.01))
    assert motion.of(reading(a=25, at=0.25)) == (positions(reading(a=25)), (0.0,) * 11), "at rest"
    motion.forget()
    assert set(motion.of(reading(a=200, at=0.3))[1]) == {0.0}, "before a lost link was no motion"


# -- a jaw -------------------------------------------------------------------------------------------------

JAW_RANGES = [
    (TWO_FINGER_85, "robotiq_85_left_knuckle_joint", 0.0, 0.7929, "rad"),
    (TWO_FINGER_140, "finger_joint", 0.0, 0.7, "rad"),
    (HAND_E, "robotiq_hande_left_finger_joint", 0.025, 0.0, "m"),
]
jaws = pytest.mark.parametrize(("model", "name", "wide", "shut", "unit"), JAW_RANGES)


def jaw(model: Model, position: int, at: float = 0.0) -> RobotiqStatus:
    return RobotiqStatus((0xF900, position, position << 8, 0, 0, 0, 0, 0), at, model=model)


@jaws
def test_a_jaw_has_the_joint_of_its_public_description(
    model: Model, name: str, wide: float, shut: float, unit: str
) -> None:
    assert joint_names("left_", model) == [f"left_{name}"]
    assert positions(jaw(model, 0)) == positions(jaw(model, 3)) == (wide,)
    assert positions(jaw(model, 228)) == positions(jaw(model, 255)) == (shut,)
    motion = Motion()
    assert motion.of(jaw(model, 50, 1.0)) == (positions(jaw(model, 50)), (0.0,))
    (there,), (velocity,) = motion.of(jaw(model, 60, 1.5))
    assert velocity == pytest.approx(2 * (there - positions(jaw(model, 50))[0]))
    assert targets([], [wide], model=model).counts == ((3, JAW),)
    assert targets([name], [shut], model=model).counts == ((228, JAW),)
    if model is TWO_FINGER_85:  # public descriptions limit it at 0.8, and clients close to that
        assert targets([], [0.8], model=model).counts == ((228, JAW),)
    beyond = max(wide, shut) * 1.02
    for names, value, why in (
        ([name], beyond, rf"must be in 0.0..{max(wide, shut)} {unit}, got"),
        ([name], -0.001 - beyond / 50, "must be in"),
        ([name], math.nan, "is nan"),
        (["fingers"], 0.0, f"there is no joint 'fingers'; these take goals: {name}"),
        (["finger_1_joint_3"], 0.0, "there is no joint"),
    ):
        with pytest.raises(GoalError, match=why):
            targets(names, [value], model=model)


@jaws
@given(position=st.integers(3, 228))
def test_a_joint_state_of_a_jaw_sent_back_leads_there(
    model: Model, name: str, wide: float, shut: float, unit: str, position: int
) -> None:
    assert targets([name], positions(jaw(model, position)), model=model).counts == ((position, JAW),)


# -- goals -------------------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("names", "angles", "counts"),
    [
        (["finger_1_joint_1"], [0.0], [(0, C)]),
        (["finger_middle_joint_1"], [1.2218], [(140, A)]),
        (["finger_middle_joint_2"], [math.radians(45)], [(190, A)]),
        (["finger_middle_joint_2"], [0.0], [(140, A)]),
        (["finger_1_joint_1", "finger_1_joint_2"], [1.2, 0.9], [(197, C)]),
        (["finger_1_joint_1", "finger_1_joint_2"], [0.5, 0.0], [(57, C)]),
        (["palm_finger_1_joint"], [0.0], [(128, S)]),
        (["fingers"], [0.0], [(0, A | B | C)]),
        (["fingers"], [2.8], [(240, A | B | C)]),
        ([], [math.radians(115)], [(190, A | B | C)]),
        (["fingers", "palm_finger_1_joint"], [0.0, 0.0], [(0, A | B | C), (128, S)]),
        (["finger_1_joint_1", "finger_2_joint_1"], [0.5, 0.7], [(57, C), (80, B)]),
        (["finger_1_joint_1", "finger_2_joint_1"], [0.5, 0.5], [(57, B | C)]),
        (["finger_1_joint_1"], [-0.0005], [(0, C)]),  # others round, too
    ],
)
def test_the_targets_of_a_goal(
    names: Sequence[str], angles: Sequence[float], counts: list[tuple[int, Finger]]
) -> None:
    assert targets(names, angles).counts == tuple(counts)


@given(st.integers(6, 240), st.integers(15, 232))
def test_a_joint_state_sent_back_as_a_goal_leads_there(finger: int, scissor: int) -> None:
    state = dict(zip(JOINTS, positions(reading(c=finger, scissor=scissor)), strict=True))
    names = ["finger_1_joint_1", "finger_1_joint_2"]
    assert targets(names, [state[name] for name in names]).counts == ((finger, C),)
    assert targets(["palm_finger_1_joint"], [state["palm_finger_1_joint"]]).counts == ((scissor, S),)


def test_the_prefix_is_taken_off() -> None:
    assert targets(["left_finger_1_joint_1"], [0.0], "left_").counts == ((0, C),)
    assert targets([], [0.0], "left_").axes == Finger.ABC
    with pytest.raises(GoalError, match="there is no joint 'finger_1_joint_1'; these take goals: left_"):
        targets(["finger_1_joint_1"], [0.0], "left_")


@pytest.mark.parametrize(
    ("names", "angles", "reason"),
    [
        (["finger_1_joint_1"], [math.nan], "the position of 'finger_1_joint_1' is nan"),
        (["left_finger_1_joint_1"], [0.1], "there is no joint 'left_finger_1_joint_1'"),
        (["finger_1_joint_3"], [-0.5], "follows other joints and takes no goal"),
        (["finger_1_joint_1", "finger_1_joint_1"], [0.1, 0.2], "two positions for one joint: 'finger_1_j"),
        (["fingers", "finger_1_joint_1"], [0.1, 0.2], "two positions for one finger: 'fingers' and"),
        (["finger_1_joint_1", "finger_1_joint_2"], [0.5, 0.5], "bends only once finger_1_joint_1 is at"),
        (["finger_1_joint_1", "finger_1_joint_2"], [1.5, 0.5], "must be in 0.0..1.2217 rad"),
        (["finger_1_joint_1"], [1.3], "'finger_1_joint_1' must be in 0.0..1.2217 rad, got 1.3000"),
        (["finger_1_joint_1"], [-0.1], "must be in"),
        (["finger_middle_joint_2"], [1.6], "must be in 0.0..1.5708 rad"),
        (["palm_finger_1_joint"], [0.2], "must be in -0.1784..0.1919 rad"),
        (["fingers"], [2.9], "must be in 0..2.8 rad"),
        (["fingers"], [-0.1], "must be in 0..2.8 rad"),
        (["fingers"], [1.0, 2.0], "1 joints and 2 positions"),
        (["x" * 1_000_000], [0.0], "there is no joint 'xxx"),
        ([], [], "no joint is named"),
        ([], [0.1, 0.2], "one position is needed, got 2"),
    ],
)
def test_goals_that_are_refused(names: Sequence[str], angles: Sequence[float], reason: str) -> None:
    with pytest.raises(GoalError) as refused:
        targets(names, angles)
    assert reason in str(refused.value)
    assert len(str(refused.value)) < 500, "a name without end is not repeated without end"


@given(st.lists(st.tuples(st.sampled_from([*JOINTS, "fingers", "", "x"]), st.floats()), max_size=5))
def test_any_goal_is_either_refused_or_within_the_range(pairs: list[tuple[str, float]]) -> None:
    try:
        goal = targets([name for name, _ in pairs], [angle for _, angle in pairs])
    except GoalError:
        return
    assert all(0 <= position <= 255 and axes for position, axes in goal.counts)
    assert sum(int(axes) for _, axes in goal.counts) == int(goal.axes) <= 15
