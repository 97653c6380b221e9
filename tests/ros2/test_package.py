"""Files of the wheel for ROS 2, and the pages about them."""

from __future__ import annotations

import ast
import os
import re
import subprocess
import sys
import tomllib
import xml.etree.ElementTree as ET
from pathlib import Path

import pytest

from robotiq_async.ros2.gripper.connection import NODE_COMMANDS
from robotiq_async.ros2.translation.settings import PARAMETERS
from robotiq_async.tools.description import urdf

ROOT = Path(__file__).parents[2]
FILES = ROOT / "packaging" / "ros2"
BUILD = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["tool"]["hatch"]["build"]
SHARED: dict[str, str] = BUILD["targets"]["wheel"]["shared-data"]
PAGE = (ROOT / "docs" / "how-to" / "ros2.md").read_text(encoding="utf-8")


def test_everything_that_ros_looks_for_is_there() -> None:
    assert set(SHARED.values()) == {
        "share/robotiq_async/package.xml",
        "share/ament_index/resource_index/packages/robotiq_async",
        "share/robotiq_async/launch/gripper.launch.py",
        "lib/robotiq_async/gripper",
    }
    assert all((ROOT / source).is_file() for source in SHARED)
    assert os.access(FILES / "gripper", os.X_OK)
    assert ET.parse(FILES / "package.xml").findtext("name") == "robotiq_async"


def test_every_package_of_ros_that_is_imported_is_a_dependency() -> None:
    imported = set()
    for file in (ROOT / "robotiq_async" / "ros2").rglob("*.py"):
        for node in ast.walk(ast.parse(file.read_text(encoding="utf-8"))):
            if isinstance(node, ast.ImportFrom) and node.level == 0 and node.module:
                imported.add(node.module.partition(".")[0])
    wanted = {each.text for each in ET.parse(FILES / "package.xml").findall("exec_depend")}
    of_ros = {each for each in imported if each.endswith(("_msgs", "_srvs", "_interfaces"))} | {"rclpy"}
    assert of_ros <= wanted


def test_arguments_of_the_launch_file_are_parameters() -> None:
    text = (FILES / "gripper.launch.py").read_text(encoding="utf-8")
    (arguments,) = re.findall(r"^ARGUMENTS = ({.*?^})", text, re.MULTILINE | re.DOTALL)
    assert set(ast.literal_eval(arguments)) <= set(PARAMETERS)


def test_the_page_has_every_parameter_and_service() -> None:
    rows = set(re.findall(r"`([^`]+)`", "".join(re.findall(r"^\| `[^|]*\||^- `[^`]+`", PAGE, re.MULTILINE))))
    assert set(PARAMETERS) <= rows
    assert {f"~/{name}" for name in NODE_COMMANDS} <= rows


def test_the_description_for_robot_state_publisher_is_one(capsys: pytest.CaptureFixture[str]) -> None:
    (script,) = re.findall(r'^python -c "(.*)" > hand\.urdf$', PAGE, re.MULTILINE)
    exec(script, {})
    assert capsys.readouterr().out == f"{urdf()}\n"


def test_without_ros_it_says_what_to_do() -> None:
    command = [sys.executable, "-m", "robotiq_async.ros2"]
    done = subprocess.run(command, capture_output=True, text=True, check=False)
    assert (done.returncode, done.stdout, done.stderr.count("\n")) == (1, "", 1)
    assert "the node needs rclpy, which comes with ROS 2 Jazzy or later: source /opt/ros/" in done.stderr
