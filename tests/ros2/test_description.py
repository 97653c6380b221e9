"""The robot description that the node publishes."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotiq_async.ros2.translation.description import prefixed, robot_description
from robotiq_async.ros2.translation.joints import joint_names
from robotiq_async.tools.description import HandModel, hand_model, urdf

URDF = (
    "<robot name='hand'><link name='palm' /><link name='tip' /><joint name='j' type='revolute'>"
    "<parent link='palm' /><child link='tip' /><mimic joint='i' /></joint></robot>"
)


@pytest.mark.parametrize("prefix", ["", "left_", "cell/3."])
def test_without_a_file_it_is_the_packaged_one_behind_the_prefix(prefix: str) -> None:
    """The same hand: every link where it was, and the joints are those of the joint states."""
    model, plain = HandModel.parse(robot_description("", prefix)), hand_model()
    assert {joint.name for joint in model.moving} == set(joint_names(prefix))
    assert model.root == f"{prefix}{plain.root}"
    angles = {joint.name: (joint.lower + joint.upper) / 3 for joint in plain.moving}
    there = model.link_poses({prefix + name: angle for name, angle in angles.items()})
    assert there == {prefix + name: pose for name, pose in plain.link_poses(angles).items()}


def test_a_prefix_stands_before_links_and_joints() -> None:
    assert robot_description("", "") == urdf()
    assert prefixed(URDF, "") == URDF
    text = prefixed(URDF, "left_").replace('"', "'")
    expected = URDF
    for name in ("palm", "tip", "j", "i"):
        expected = expected.replace(f"'{name}'", f"'left_{name}'")
    assert text == expected


def test_a_file_is_published_as_it_is_unless_it_is_no_urdf(tmp_path: Path) -> None:
    file = tmp_path / "hand.urdf"
    file.write_text(URDF, encoding="utf-8")
    assert robot_description(str(file), "left_") == URDF
    for text in ("", "<sdf/>", "no XML"):
        file.write_text(text, encoding="utf-8")
        with pytest.raises(ValueError, match=r"hand\.urdf is no URDF: "):
            robot_description(str(file), "")
