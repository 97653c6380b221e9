"""URDF and SRDF of each model in programs of others, which need an environment of their own.

Pinocchio reads a URDF with urdfdom, the library with which MoveIt loads one. Tesseract plans with an SRDF as
MoveIt does, and reads it with a parser of its own. MoveIt itself is in no package index, and was not tried.
"""

from __future__ import annotations

from collections.abc import Mapping
from math import dist
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio
import pytest
from tesseract_robotics.tesseract_common import GeneralResourceLocator
from tesseract_robotics.tesseract_environment import Environment

from robotiq_async.ros2.translation.description import robot_description
from robotiq_async.tools.description import HandModel, Pose, hand_model, srdf
from robotiq_async.tools.description.kinematics import named_states
from robotiq_async.values.enums import JAW
from robotiq_async.values.model import MODELS, THREE_FINGER, TWO_FINGER_85

ALL = pytest.mark.parametrize("name", MODELS)
PREFIX = pytest.mark.parametrize("prefix", ["", "left_"])
JAWS = pytest.mark.parametrize("name", [name for name, model in MODELS.items() if model is not THREE_FINGER])


def loaded(name: str, prefix: str = "") -> Any:
    """The model in Pinocchio, in which joints follow another where it can do that."""
    follows = MODELS[name] is not TWO_FINGER_85
    return pinocchio.buildModelFromXML(robot_description("", prefix, name), mimic=follows)


def places(model: Any, values: Mapping[str, float], prefix: str = "") -> dict[str, Pose]:
    """Where Pinocchio puts the links; it is told the values of joints that it moves itself."""
    q = pinocchio.neutral(model)
    for joint, value in values.items():
        own = model.joints[model.getJointId(prefix + joint)]
        if own.nv:
            q[own.idx_q] = value
    data = model.createData()
    pinocchio.framesForwardKinematics(model, data, q)
    placed = {
        frame.name.removeprefix(prefix): data.oMf[index]
        for index, frame in enumerate(model.frames)
        if frame.type == pinocchio.FrameType.BODY
    }
    return {link: Pose(tuple(pose.translation), rows(pose.rotation)) for link, pose in placed.items()}


def rows(matrix: Any) -> Any:
    return tuple(map(tuple, matrix))


# -- the URDF --------------------------------------------------------------------------------------------


@ALL
@PREFIX
def test_links_are_where_the_description_has_them(name: str, prefix: str) -> None:
    hand = hand_model(name)
    asked = {joint.name: (joint.lower + 3 * joint.upper) / 4 for joint in hand.moving if joint.mimic is None}
    model = loaded(name, prefix)
    follows = MODELS[name] is not TWO_FINGER_85
    assert model.nq == (len(asked) if follows else len(hand.moving))
    # Joints that follow get no value, but where Pinocchio cannot do it.
    found = places(model, asked if follows else hand.completed(asked), prefix)
    expected = hand.link_poses(asked)
    assert found.keys() == expected.keys()
    for link, pose in expected.items():
        assert found[link].position == pytest.approx(pose.position, abs=1e-6), link
        assert np.array(found[link].rotation) == pytest.approx(np.array(pose.rotation), abs=1e-4), link


@PREFIX
def test_pinocchio_does_not_take_the_2f85_with_joints_that_follow(prefix: str) -> None:
    """It builds joints by the order of their names, and the one that the others follow is not the first."""
    with pytest.raises(ValueError, match="parent joint of the mimic joint is not in the kinematic tree"):
        pinocchio.buildModelFromXML(robot_description("", prefix, TWO_FINGER_85), mimic=True)


@ALL
def test_links_have_the_masses_of_the_description(name: str) -> None:
    hand, model = hand_model(name), loaded(name)
    fixed = {joint.child for joint in hand.joints if joint.axis is None}
    moved = sum(link.mass for link in hand.links.values() if link.name not in {hand.root, *fixed})
    assert pinocchio.computeTotalMass(model) == pytest.approx(moved, rel=1e-4)


# -- the SRDF --------------------------------------------------------------------------------------------


def states(name: str, prefix: str, folder: Path) -> tuple[Any, dict[str, Any]]:
    file = folder / "gripper.srdf"
    file.write_text(srdf(name, prefix), encoding="utf-8")
    model = loaded(name, prefix)
    pinocchio.loadReferenceConfigurations(model, str(file))
    return model, {each.key(): each.data() for each in model.referenceConfigurations}


@ALL
@PREFIX
def test_a_gripper_with_its_srdf_does_not_collide_with_itself(name: str, prefix: str, tmp_path: Path) -> None:
    model, _ = states(name, prefix, tmp_path)
    bodies = pinocchio.buildGeomFromUrdfString(
        model, robot_description("", prefix, name), pinocchio.GeometryType.COLLISION
    )
    bodies.addAllCollisionPairs()
    data, geometry = model.createData(), bodies.createData()
    assert pinocchio.computeCollisions(model, data, bodies, geometry, pinocchio.neutral(model), True)
    pinocchio.removeCollisionPairs(model, bodies, str(tmp_path / "gripper.srdf"))
    assert not len(bodies.collisionPairs)


@JAWS
def test_an_open_jaw_is_open_by_its_stroke_and_a_closed_one_is_closed(name: str, tmp_path: Path) -> None:
    hand = hand_model(name)
    model, found = states(name, "", tmp_path)
    assert found.keys() == {"open", "closed"}
    leader = next(joint.name for joint in hand.moving if joint.mimic is None)
    at = {state: q[model.joints[model.getJointId(leader)].idx_q] for state, q in found.items()}
    gaps = {state: apart(hand, places(model, hand.completed({leader: value}))) for state, value in at.items()}
    assert 1000 * gaps["open"] == pytest.approx(MODELS[name].stroke.mm, abs=0.01)
    assert 1000 * gaps["closed"] == pytest.approx(0, abs=0.01)


def apart(hand: HandModel, links: Mapping[str, Pose]) -> float:
    """The distance between the faces of the pads, which are parallel."""
    pads = [hand.pad(link) for link in hand.touching[JAW]]
    middles = [
        (links[link] @ pad.origin).position for link, pad in zip(hand.touching[JAW], pads, strict=True)
    ]
    return dist(*middles) - sum(pad.size[0] for pad in pads) / 2


@ALL
@PREFIX
def test_tesseract_reads_the_group_its_states_and_the_collisions_to_ignore(
    name: str, prefix: str, capfd: pytest.CaptureFixture[str]
) -> None:
    cell, hand = Environment(), hand_model(name)
    text = robot_description("", prefix, name)
    assert cell.init(text, srdf(name, prefix), GeneralResourceLocator())
    known = cell.getKinematicsInformation()
    group = f"{prefix}gripper"
    assert {each: {*links} for each, links in dict(known.link_groups).items()} == {
        group: {prefix + link for link in hand.links}
    }
    found = {state: dict(values) for state, values in dict(known.group_states[group]).items()}
    assert found.keys() == named_states(MODELS[name]).keys()
    for state, values in named_states(MODELS[name]).items():
        prefixed = {prefix + joint: value for joint, value in values.items()}
        assert found[state] == pytest.approx(prefixed, abs=1e-5)
    allowed = cell.getAllowedCollisionMatrix()
    assert all(
        allowed.isCollisionAllowed(prefix + one, prefix + other)
        for one in hand.links
        for other in hand.links
        if one != other
    )
    assert not capfd.readouterr().err


def test_tesseract_refuses_an_srdf_with_other_names(capfd: pytest.CaptureFixture[str]) -> None:
    assert not Environment().init(
        robot_description("", "", TWO_FINGER_85), srdf(TWO_FINGER_85, "left_"), GeneralResourceLocator()
    )
    assert "left_robotiq_85_base_link" in capfd.readouterr().err
