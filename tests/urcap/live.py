"""Clients of the URCap's text port that need an environment of their own, on the simulated one."""

from __future__ import annotations

import asyncio
import importlib.metadata
import importlib.util
from types import ModuleType
from typing import Any

import pytest
from airo_robots.grippers.hardware.robotiq_2f85_urcap import Robotiq2F85

from robotiq_async import JAW, TWO_FINGER_85
from robotiq_async.simulator import SimulatedGripper, UrcapSimulatorServer
from tests.docs.pages import blocks, read
from tests.link.test_urcap_clients import gripper, server

__all__ = ["gripper", "server"]
SHOWN = 206  # of a part at 200: a contact at full speed reads 6 counts further, as recorded


async def test_airo_robots(gripper: SimulatedGripper, server: UrcapSimulatorServer) -> None:
    """It opens a connection for each line, cuts one character off each answer, and writes two blanks."""

    def use() -> tuple[float, bool, float]:
        driver = Robotiq2F85("127.0.0.1", server.port)
        driver.move(0.04).wait()
        width = driver.get_current_width()
        gripper.place_object(JAW, 200)
        driver.close().wait()
        return width, driver.is_an_object_grasped(), driver.get_current_width()

    width, is_held, held = await asyncio.to_thread(use)
    assert width == pytest.approx(0.04, abs=0.002)
    assert is_held
    assert held == pytest.approx(0.085 * (230 - SHOWN) / 230, abs=0.001)


def example_of_ur_rtde() -> ModuleType:
    """The driver of ur_rtde's examples, which GELLO has a copy of, too: rcs-ur5e brings it to the index.

    Loaded from its file, for the package imports ur_rtde and the rest of that project.
    """
    path = importlib.metadata.distribution("rcs-ur5e").locate_file("rcs_ur5e/robotiq_gripper.py")
    spec = importlib.util.spec_from_file_location("example_of_ur_rtde", str(path))
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


async def test_the_example_of_ur_rtde(gripper: SimulatedGripper, server: UrcapSimulatorServer) -> None:
    """It compares the answer to a SET with ``ack``, and reads its variables while the gripper moves."""
    example = example_of_ur_rtde()

    def use() -> tuple[tuple[int, int], list[tuple[int, str]]]:
        driver = example.RobotiqGripper()
        driver.connect("127.0.0.1", server.port)
        driver.activate()  # and finds the ends of its range
        gripper.place_object(JAW, 120)
        ends = [driver.move_and_wait_for_pos(target, 255, 64) for target in (80, 255, 0)]
        driver.disconnect()
        limits = driver.get_min_position(), driver.get_max_position()
        return limits, [(position, status.name) for position, status in ends]

    (low, high), ends = await asyncio.to_thread(use)
    assert low <= TWO_FINGER_85.open_reading_max
    assert high >= TWO_FINGER_85.closed_reading_min
    assert ends == [(80, "AT_DEST"), (126, "STOPPED_INNER_OBJECT"), (3, "AT_DEST")]


async def test_the_recipe_for_airo_robots(gripper: SimulatedGripper, server: UrcapSimulatorServer) -> None:
    """As the page has it, at the same port."""
    (recipe,) = blocks(read("how-to/coming-from.md"), "py")
    names: dict[str, Any] = {}
    exec(compile(recipe.text, "coming-from.md", "exec"), names)

    def use() -> tuple[float, bool, float]:
        driver = names["Robotiq"](server.address)
        driver.move(0.04).wait()
        width = driver.get_current_width()
        gripper.place_object(JAW, 200)
        driver.close().wait()
        held = driver.is_an_object_grasped(), driver.get_current_width()
        driver._hand.stop()
        return width, *held

    width, is_held, held = await asyncio.to_thread(use)
    assert width == pytest.approx(0.04, abs=0.002)
    assert is_held
    assert held == pytest.approx(0.085 * (228 - SHOWN) / 225, abs=0.001)
