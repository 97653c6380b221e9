"""The robot description that the node publishes."""

from __future__ import annotations

from pathlib import Path

import pytest

from robotiq_async.ros2.translation.description import prefixed, robot_description
from robotiq_async.ros2.translation.joints import joint_names
from robotiq_async.tools.description import HandModel, urdf

URDF = (
    "<robot name='hand'><link name='palm' /><link name='tip' /><joint name='j' type='revolute'>"
    "<parent link='palm' /><child link='tip' /><mimic joint='i' /></joint></robot>"
)


def test_a_prefix_stands_before_links_and_joints() -> None:
    assert robot_description("", "") == urdf()
    assert {joint.name for joint in HandModel.parse(robot_description("", "cell/3.")).moving} == set(
        joint_names("cell/3.")
    )
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
