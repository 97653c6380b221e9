"""The description that the node publishes, read by urdfdom: here that of cmeel-urdfdom.

MoveIt and robot_state_publisher load a URDF with its ``urdf::parseURDF``. MoveIt itself is no wheel: it was
not tried.
"""

from __future__ import annotations

import json
import os
import shlex
import subprocess
import sysconfig
from pathlib import Path
from typing import Any

import pytest

from robotiq_async.ros2.translation.description import robot_description
from robotiq_async.tools.description import Joint, Pose, RigidLink, hand_model
from robotiq_async.tools.description.shapes import inertia
from robotiq_async.values.model import MODELS

SOURCE = Path(__file__).with_name("urdfdom.cpp")
ROOT = Path(sysconfig.get_path("purelib"), "cmeel.prefix")
TYPES = {"revolute": 1, "prismatic": 3, "fixed": 6}


@pytest.fixture(scope="module")
def program(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A program that prints what urdfdom reads, as JSON."""
    file = tmp_path_factory.mktemp("urdfdom") / "urdfdom"
    compiler = shlex.split(os.environ.get("CXX", "c++"))
    headers = [f"-I{ROOT / 'include' / name}" for name in ("urdfdom", "urdfdom_headers")]
    library = [f"-L{ROOT / 'lib'}", f"-Wl,-rpath,{ROOT / 'lib'}", "-lurdfdom_model"]
    subprocess.run([*compiler, "-std=c++17", str(SOURCE), "-o", str(file), *headers, *library], check=True)
    return file


def read(program: Path, text: str, folder: Path) -> Any:
    """The robot that the parser makes of a URDF, if it takes it without a word."""
    file = folder / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    answer = subprocess.run([program, file], capture_output=True, text=True, check=True)
    assert not answer.stderr
    return json.loads(answer.stdout)


@pytest.mark.parametrize("prefix", ["", "left_"])
@pytest.mark.parametrize("name", MODELS)
async def test_the_parser_of_ros_reads_what_the_description_says(
    name: str, prefix: str, program: Path, tmp_path: Path
) -> None:
    hand = hand_model(name)
    found = read(program, robot_description("", prefix, name), tmp_path)
    assert (found["name"], found["root"]) == (hand.name, prefix + hand.root)
    assert found["links"].keys() == {prefix + link for link in hand.links}
    assert found["joints"].keys() == {prefix + joint.name for joint in hand.joints}
    for link in hand.links.values():
        check_link(link, found["links"][prefix + link.name])
    for joint in hand.joints:
        check_joint(joint, found["joints"][prefix + joint.name], prefix)
    assert sum(link["mass"] for link in found["links"].values()) == pytest.approx(hand.mass, rel=1e-4)


def check_link(link: RigidLink, found: Any) -> None:
    centre, moments, products = inertia(link)
    assert found["mass"] == pytest.approx(link.mass, rel=1e-5)
    assert found["inertia"] == pytest.approx([*moments, *products], rel=1e-5, abs=1e-9)
    check_pose(Pose(centre), found["centre"])
    for kind in ("visual", "collision"):
        assert len(found[kind]) == len(link.shapes)
        for shape, (name, (form, size), origin) in zip(link.shapes, found[kind], strict=True):
            assert name == (f"{link.name}_{shape.name}_{kind}" if shape.name else "")
            assert form == shape.kind
            assert size == pytest.approx(shape.size, rel=1e-5)
            check_pose(shape.origin, origin)


def check_joint(joint: Joint, found: Any, prefix: str) -> None:
    kind = "fixed" if joint.axis is None else "prismatic" if joint.slides else "revolute"
    assert found["type"] == TYPES[kind]
    assert (found["parent"], found["child"]) == (prefix + joint.parent, prefix + joint.child)
    check_pose(joint.origin, found["origin"])
    if joint.axis is not None:
        assert found["axis"] == pytest.approx(joint.axis)
        limits = (joint.lower, joint.upper, joint.effort, joint.velocity)
        assert found["limits"] == pytest.approx(limits, rel=1e-5)
    follows = joint.mimic and [prefix + joint.mimic.joint, joint.mimic.multiplier, 0]
    assert found.get("mimic") == follows


def check_pose(pose: Pose, found: Any) -> None:
    position, quaternion = found
    assert position == pytest.approx(pose.position, abs=1e-6)
    sign = -1 if quaternion[3] < 0 else 1
    assert [sign * each for each in quaternion] == pytest.approx(pose.quaternion, abs=1e-5)


async def test_the_parser_of_ros_refuses_a_joint_without_its_parent(program: Path, tmp_path: Path) -> None:
    """It does not take everything."""
    text = robot_description("", "", "2f85")
    with pytest.raises(subprocess.CalledProcessError):
        read(program, text.replace('link="robotiq_85_base_link"', 'link="nothing"', 1), tmp_path)
