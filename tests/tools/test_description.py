"""The description of the 3-Finger: its texts, and the places of its links. The others: test_jaws.py."""

from __future__ import annotations

import cmath
from math import cos, dist, isclose, pi, sin, sqrt

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.tools.description import Pose, hand_model
from robotiq_async.tools.description.geometry import Vector, from_rpy, turned
from robotiq_async.tools.description.kinematics import FINGER_NAMES, JOINTS, finger_angles, palm_angle

MODEL = hand_model()
ANGLE = st.floats(-pi, pi)
FINGERS = tuple(FINGER_NAMES.values())


def at(position: int, scissor: int = 137) -> dict[str, float]:
    """The angles of a hand whose fingers are all at a position."""
    palm, finger = palm_angle(scissor), finger_angles(position)
    return dict(zip(JOINTS, (palm, *finger, -palm, *finger, *finger), strict=True))


def test_the_joints_are_those_of_the_joint_states() -> None:
    assert {joint.name for joint in MODEL.moving} == set(JOINTS)
    assert len(MODEL.moving) == 11
    assert [joint.name for joint in MODEL.joints if joint.axis is None] == ["palm_finger_middle_joint"]


def test_the_links_form_one_tree_on_the_frame_that_joint_states_name() -> None:
    assert MODEL.root == "palm"
    for finger in FINGERS:
        chain = [joint for joint in MODEL.joints if joint.child.startswith(finger)]
        assert [joint.child for joint in chain] == [f"{finger}_link_{number}" for number in range(4)]
        assert [joint.parent for joint in chain] == ["palm", *[f"{finger}_link_{n}" for n in range(3)]]


def test_no_position_of_the_gripper_leaves_the_limits() -> None:
    """The limits are written with five digits."""
    for counts in range(256):
        angles = at(counts, counts)
        for joint in MODEL.moving:
            assert joint.lower - 1e-4 <= angles[joint.name] <= joint.upper + 1e-4, joint.name


def test_every_limit_is_reached() -> None:
    ends = [at(counts, counts) for counts in (0, 255)]
    for joint in MODEL.moving:
        reached = sorted(angles[joint.name] for angles in ends)
        assert reached == pytest.approx([joint.lower, joint.upper], abs=1e-4)


# -- where the links are ---------------------------------------------------------------------------------


def in_its_plane(base: float, middle: float, tip: float) -> tuple[complex, complex, float]:
    """Joint 3, the tip's far end and the tip's direction; real is out of the palm, imaginary inwards.

    Complex numbers and no matrix: nothing here is shared with what is tested.
    """
    knee = 0.020 + (0.050 - 0.028j) * cmath.exp(1j * base)
    heading = base + middle - pi / 6
    last = knee + cmath.rect(0.039, heading)
    return last, last + cmath.rect(0.041, heading + tip + pi / 6), heading + tip + pi / 6


@pytest.mark.parametrize("position", [0, 60, 110, 140, 200, 255])
def test_finger_a_is_where_plane_geometry_says(position: int) -> None:
    poses = MODEL.link_poses(at(position))
    last, far, direction = in_its_plane(*finger_angles(position))
    link = poses["finger_middle_link_3"]
    assert link.position == pytest.approx((0.0455 - last.imag, 0.0214 + last.real, 0), abs=1e-5)
    end = link.apply((0.041 * cos(pi / 6), 0.041 * sin(pi / 6), 0))
    assert end == pytest.approx((0.0455 - far.imag, 0.0214 + far.real, 0), abs=1e-5)
    drawn = cmath.phase(complex(end[1] - link.position[1], link.position[0] - end[0]))
    assert isclose(drawn, direction, abs_tol=1e-4)


@pytest.mark.parametrize("scissor", [0, 90, 137, 255])
@pytest.mark.parametrize(("finger", "side"), [("finger_1", 1), ("finger_2", -1)])
def test_b_and_c_are_a_mirrored_and_tilted_by_the_scissor(scissor: int, finger: str, side: int) -> None:
    last, _, _ = in_its_plane(*finger_angles(80))
    tilt = palm_angle(scissor)
    expected = (-0.0455 + last.imag, 0.0214 + last.real * cos(tilt), side * (0.036 + last.real * sin(tilt)))
    poses = MODEL.link_poses(at(80, scissor))
    assert poses[f"{finger}_link_3"].position == pytest.approx(expected, abs=1e-5)


def test_wide_spreads_b_and_c_and_pinch_brings_them_together() -> None:
    pads = [touching(MODEL.link_poses(at(6, scissor))) for scissor in (24, 137, 219)]
    gaps = [dist(each["finger_1"], each["finger_2"]) for each in pads]
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[2] > 0.02, "the tips of B and C are 22 mm wide"


def touching(poses: dict[str, Pose]) -> dict[str, Vector]:
    return {
        finger: poses[f"{finger}_link_3"].apply(MODEL.pad(f"{finger}_link_3").origin.position)
        for finger in FINGERS
    }


def test_closing_brings_the_tips_to_each_other() -> None:
    gaps = []
    for position in range(0, 111, 10):
        pads = touching(MODEL.link_poses(at(position)))
        gaps.append(pads["finger_middle"][0] - pads["finger_1"][0])
    assert gaps == sorted(gaps, reverse=True)
    assert gaps[0] == pytest.approx(0.169, abs=0.002), "166 mm between the faces of the pads: see the file"


def test_the_tips_stay_parallel_while_they_close() -> None:
    """The pad looks at the other side of the hand, whatever the position."""
    tip = "finger_middle_link_3"
    for position in range(0, 111, 5):
        pose = MODEL.link_poses(at(position))[tip] @ MODEL.pad(tip).origin
        assert pose.rotation[0][1] == pytest.approx(-1, abs=1e-4)


def test_a_joint_that_is_not_named_is_straight_and_others_are_left_alone() -> None:
    assert MODEL.link_poses({}) == MODEL.link_poses(dict.fromkeys(JOINTS, 0.0) | {"elbow": 1.0})


# -- poses -----------------------------------------------------------------------------------------------


@given(st.tuples(ANGLE, ANGLE, ANGLE))
def test_roll_pitch_yaw_are_those_of_urdf(rpy: Vector) -> None:
    """Against the closed form that every textbook has."""
    (r, p, y), rotation = rpy, from_rpy((0, 0, 0), rpy).rotation
    assert rotation[0] == pytest.approx(
        (
            cos(y) * cos(p),
            cos(y) * sin(p) * sin(r) - sin(y) * cos(r),
            cos(y) * sin(p) * cos(r) + sin(y) * sin(r),
        ),
        abs=1e-9,
    )
    assert rotation[2] == pytest.approx((-sin(p), cos(p) * sin(r), cos(p) * cos(r)), abs=1e-9)


@given(st.tuples(ANGLE, ANGLE, ANGLE))
def test_a_quaternion_turns_as_its_matrix(rpy: Vector) -> None:
    pose = from_rpy((0, 0, 0), rpy)
    x, y, z, w = pose.quaternion
    assert x * x + y * y + z * z + w * w == pytest.approx(1)
    assert w >= 0
    again = ((1 - 2 * (y * y + z * z), 2 * (x * y - z * w), 2 * (x * z + y * w)),)
    assert again[0] == pytest.approx(pose.rotation[0], abs=1e-9)
    assert (2 * (x * z - y * w), 2 * (y * z + x * w)) == pytest.approx(pose.rotation[2][:2], abs=1e-9)


def test_an_axis_may_have_any_length_but_zero() -> None:
    third = turned((3, 3, 3), 2 * pi / 3)
    assert third.apply((1, 0, 0)) == pytest.approx((0, 1, 0))
    assert third.quaternion == pytest.approx((0.5, 0.5, 0.5, 0.5))
    assert turned((0, sqrt(2), 0), 0) == Pose()
    with pytest.raises(ValueError, match="must have a length"):
        turned((0, 0, 0), 1)


def test_a_link_without_a_pad_is_an_error() -> None:
    with pytest.raises(KeyError, match="palm has no pad"):
        MODEL.pad("palm")
