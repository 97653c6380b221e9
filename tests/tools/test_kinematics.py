"""Eleven joints from four positions."""

from __future__ import annotations

from math import degrees, radians

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import Finger
from robotiq_async.tools.description.kinematics import (
    FINGER_NAMES,
    JOINTS,
    finger_angles,
    joint_angles,
    joint_velocities,
    palm_angle,
)
from tests.register_words import status_of

HALF_TURN = 3.2


@pytest.mark.parametrize(
    ("position", "base", "middle", "tip"),
    [
        (0, 0, 0, 0),
        (70, 35, 0, -35),
        (110, 55, 0, -55),
        (140, 70, 0, -55),
        (190, 70, 45, -55),
        (240, 70, 90, -55),
        (255, 70, 90, -55),
    ],
)
def test_the_phases_of_a_finger(position: int, base: float, middle: float, tip: float) -> None:
    assert [degrees(angle) for angle in finger_angles(position)] == pytest.approx([base, middle, tip])


def test_no_joint_jumps() -> None:
    for position in range(255):
        for before, after in zip(finger_angles(position), finger_angles(position + 1), strict=True):
            assert abs(after - before) < radians(1)


@pytest.mark.parametrize(("scissor", "angle"), [(0, 11), (15, 11), (127.5, 0), (240, -11), (255, -11)])
def test_the_scissor_turns_the_palm_joints(scissor: float, angle: float) -> None:
    if scissor == int(scissor):
        assert degrees(palm_angle(int(scissor))) == pytest.approx(angle)
    else:
        assert degrees(palm_angle(127) + palm_angle(128)) / 2 == pytest.approx(angle)


@given(st.tuples(*[st.integers(0, 255)] * 4))
def test_every_axis_moves_its_own_joints(positions: tuple[int, int, int, int]) -> None:
    status = status_of(0xF9, 0xFF, position=positions)
    angles = dict(zip(JOINTS, joint_angles(status), strict=True))
    assert len(set(JOINTS)) == len(angles) == 11
    for name, finger in (("1", Finger.C), ("2", Finger.B), ("middle", Finger.A)):
        mine = tuple(angles[f"finger_{name}_joint_{joint}"] for joint in (1, 2, 3))
        assert mine == finger_angles(status.position(finger))
    palm = palm_angle(status.position(Finger.SCISSOR))
    assert (angles["palm_finger_1_joint"], angles["palm_finger_2_joint"]) == (palm, -palm)
    assert all(abs(angle) < HALF_TURN for angle in angles.values())


def test_one_map_names_the_fingers() -> None:
    """docs/decisions/finger-names.md has the reason. A change of it changes the joints, too."""
    assert list(FINGER_NAMES.items()) == [
        (Finger.C, "finger_1"),
        (Finger.B, "finger_2"),
        (Finger.A, "finger_middle"),
    ]
    fingers = [name.partition("_joint_")[0] for name in JOINTS if not name.startswith("palm")]
    assert fingers == [name for name in FINGER_NAMES.values() for _ in range(3)]


def test_velocities() -> None:
    before = status_of(0xF9, 0xFF, position=(0, 0, 0, 15), at=1.0)
    after = status_of(0xF9, 0xFF, position=(14, 0, 0, 15), at=1.5)
    velocities = dict(zip(JOINTS, joint_velocities(before, after), strict=True))
    assert velocities.pop("finger_middle_joint_1") == pytest.approx(radians(14))
    assert velocities.pop("finger_middle_joint_3") == pytest.approx(radians(-14))
    assert set(velocities.values()) == {0.0}
    with pytest.raises(ValueError, match="after must be later than before"):
        joint_velocities(before, before)
