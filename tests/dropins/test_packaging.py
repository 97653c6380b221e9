"""The second distribution, by which LeRobot finds the robot."""

from __future__ import annotations

import tomllib

from robotiq_async import __version__
from tests.docs.pages import ROOT

FOLDER = ROOT / "packaging" / "lerobot_robot_robotiq"
PROJECT = tomllib.loads((FOLDER / "pyproject.toml").read_text(encoding="utf-8"))["project"]


def test_its_name_is_one_that_lerobot_looks_for_and_that_of_its_module() -> None:
    """LeRobot 0.6.1 imports the distributions whose raw names begin so: with dashes none is found."""
    assert PROJECT["name"].startswith("lerobot_robot_")
    assert (FOLDER / f"{PROJECT['name']}.py").is_file()


def test_it_is_of_the_version_of_the_library_and_needs_that_one() -> None:
    assert PROJECT["version"] == __version__
    assert PROJECT["dependencies"] == [f"robotiq-async[serial]=={__version__}"]
