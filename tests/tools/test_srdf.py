"""The SRDF of each model: what MoveIt asks of one, beside the URDF with the same prefix."""

from __future__ import annotations

import xml.etree.ElementTree as ET
from itertools import combinations

import pytest

from robotiq_async.ros2.translation.description import robot_description
from robotiq_async.ros2.translation.joints import targets
from robotiq_async.tools.description import hand_model, srdf
from robotiq_async.tools.description.kinematics import FINGER_NAMES
from robotiq_async.values.enums import JAW, Finger
from robotiq_async.values.model import MODELS, THREE_FINGER, TWO_FINGER_85

ALL = pytest.mark.parametrize("name", MODELS)
PREFIX = pytest.mark.parametrize("prefix", ["", "cell/3."])


def names(parts: list[ET.Element]) -> list[str]:
    return [part.attrib["name"] for part in parts]


@ALL
@PREFIX
def test_the_group_is_the_whole_gripper_of_the_urdf(name: str, prefix: str) -> None:
    urdf, robot = ET.fromstring(robot_description("", prefix, name)), ET.fromstring(srdf(name, prefix))
    assert robot.get("name") == urdf.get("name"), "MoveIt takes no other"
    (group,) = robot.findall("group")
    assert group.get("name") == f"{prefix}gripper"
    assert names(group.findall("link")) == names(urdf.findall("link"))


@ALL
@PREFIX
def test_a_state_has_every_joint_that_follows_no_other_within_its_limits(name: str, prefix: str) -> None:
    """MoveIt warns of a joint that is not named."""
    robot = ET.fromstring(srdf(name, prefix))
    limits = {joint.name: (joint.lower, joint.upper) for joint in hand_model(name).moving if not joint.mimic}
    assert names(robot.findall("group_state")) == ["open", "closed"]
    for state in robot.findall("group_state"):
        assert state.get("group") == f"{prefix}gripper"
        assert names(state.findall("joint")) == [prefix + joint for joint in limits]
        for joint in state.findall("joint"):
            lower, upper = limits[joint.attrib["name"].removeprefix(prefix)]
            assert lower <= float(joint.attrib["value"]) <= upper


@ALL
@PREFIX
def test_no_two_links_of_the_gripper_collide(name: str, prefix: str) -> None:
    robot, hand = ET.fromstring(srdf(name, prefix)), hand_model(name)
    found = {
        frozenset((pair.attrib["link1"], pair.attrib["link2"])): pair.attrib["reason"]
        for pair in robot.findall("disable_collisions")
    }
    links = [prefix + link for link in hand.links]
    assert found.keys() == {frozenset(pair) for pair in combinations(links, 2)}
    assert len(robot.findall("disable_collisions")) == len(found)
    adjacent = {pair for pair, reason in found.items() if reason == "Adjacent"}
    assert adjacent == {frozenset((prefix + each.parent, prefix + each.child)) for each in hand.joints}


@ALL
@PREFIX
def test_the_node_takes_the_joints_of_a_state_that_are_not_passive(name: str, prefix: str) -> None:
    """MoveIt sends these to a controller, and no others."""
    model, robot = MODELS[name], ET.fromstring(srdf(name, prefix))
    passive = names(robot.findall("passive_joint"))
    sent = []
    for state in robot.findall("group_state"):
        values = {each.attrib["name"]: float(each.attrib["value"]) for each in state}
        active = [joint for joint in values if joint not in passive]
        moved = targets(active, [values[joint] for joint in active], prefix, model)
        sent.append({axis: position for position, axes in moved.counts for axis in axes})
    if model is THREE_FINGER:
        assert sent == [dict.fromkeys(FINGER_NAMES, at) | {Finger.SCISSOR: 128} for at in (0, 240)]
    else:
        assert sent == [{JAW: model.stroke.open_reading}, {JAW: model.stroke.closed_reading}]


def test_a_note_says_what_is_missing_with_an_arm() -> None:
    assert 'parent_link="LINK OF THE ARM" group="left_gripper"' in srdf(TWO_FINGER_85, "left_")
    assert srdf() == srdf("3f")
    with pytest.raises(ValueError, match="one of 3f, 2f85"):
        srdf("4f")
