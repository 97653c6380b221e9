"""The description that the node publishes, read by the parser of ROS: urdfdom, here that of cmeel-urdfdom.

MoveIt and robot_state_publisher read a URDF with it. MoveIt itself is no wheel, and was not tried.
"""

from __future__ import annotations

import re
import subprocess
import sys
from pathlib import Path

import pytest

from robotiq_async.ros2.translation.description import robot_description
from robotiq_async.tools.description import hand_model
from robotiq_async.values.model import MODELS

CHECK = Path(sys.executable).with_name("check_urdf")


def read(text: str, folder: Path) -> tuple[str, list[str]]:
    """The root link and all others, as the parser has them; it prints a tree of these."""
    file = folder / "robot.urdf"
    file.write_text(text, encoding="utf-8")
    answer = subprocess.run([str(CHECK), str(file)], capture_output=True, text=True, check=True)
    assert not answer.stderr
    (root,) = re.findall(r"^root Link: (\S+) has", answer.stdout, re.MULTILINE)
    return root, re.findall(r"^ +child\(\d+\): +(\S+)$", answer.stdout, re.MULTILINE)


@pytest.mark.parametrize("prefix", ["", "left_"])
@pytest.mark.parametrize("name", MODELS)
async def test_the_parser_of_ros_finds_every_link(name: str, prefix: str, tmp_path: Path) -> None:
    model = hand_model(name)
    root, others = read(robot_description("", prefix, name), tmp_path)
    assert root == prefix + model.root
    assert sorted([root, *others]) == sorted(prefix + link for link in model.links)


async def test_the_parser_of_ros_says_what_is_wrong(tmp_path: Path) -> None:
    """And does not take everything."""
    text = robot_description("", "", "2f85")
    with pytest.raises(subprocess.CalledProcessError):
        read(text.replace('<parent link="robotiq_85_base_link"', '<parent link="nothing"', 1), tmp_path)
