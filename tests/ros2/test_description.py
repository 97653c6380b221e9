"""The robot description that the node publishes."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from robotiq_async.ros2.translation.description import prefixed, robot_description
from robotiq_async.ros2.translation.joints import joint_names
from robotiq_async.tools.description import kinematics, urdf
from robotiq_async.values.model import MODELS

URDF = (
    "<robot name='hand'><link name='palm' /><link name='tip' /><joint name='j' type='revolute'>"
    "<parent link='palm' /><child link='tip' /><mimic joint='i' /></joint></robot>"
)


def moving(text: str) -> set[str]:
    """The joints that something must name: neither fixed nor following another."""
    joints = ET.fromstring(text).findall("joint")
    return {
        joint.attrib["name"]
        for joint in joints
        if joint.get("type") != "fixed" and joint.find("mimic") is None
    }


@pytest.mark.parametrize("name", MODELS)
def test_the_joint_states_name_every_joint_of_the_description_that_is_free(name: str) -> None:
    text = robot_description("", "left_", name)
    assert moving(text) == {f"left_{each}" for each in kinematics.joint_names(MODELS[name])}
    assert text == prefixed(urdf(name), "left_")


def test_a_prefix_stands_before_links_and_joints() -> None:
    assert robot_description("", "") == urdf()
    assert moving(robot_description("", "cell/3.")) == set(joint_names("cell/3."))
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
