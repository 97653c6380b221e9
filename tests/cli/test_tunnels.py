"""The address of a tunnel where addresses are: commands, FLEET.toml, the ROS node, the blocking hand."""

from __future__ import annotations

import asyncio
import json
import threading
from collections.abc import Iterator
from pathlib import Path

import pytest

from robotiq_async import JAW
from robotiq_async.cli.agent_file import read_agent_file
from robotiq_async.cli.connect import make_served
from robotiq_async.ros2.gripper.connection import make_hand as make_hand_of_node
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.sync import RobotiqHand
from robotiq_async.values.model import TWO_FINGER_85
from tests.arms import arm_with_jaw, install_schemes
from tests.cli.conftest import Call
from tests.grippers import active_gripper


@pytest.fixture
def address(monkeypatch: pytest.MonkeyPatch, tmp_path: Path) -> Iterator[str]:
    """That of a jaw which is active, through an arm in a thread."""
    install_schemes(monkeypatch, tmp_path)
    loop = asyncio.new_event_loop()
    thread = threading.Thread(target=loop.run_forever)
    thread.start()
    arm = arm_with_jaw("XArm", gripper=active_gripper(model=TWO_FINGER_85))
    there, _, _ = asyncio.run_coroutine_threadsafe(arm.__aenter__(), loop).result()
    yield f"xarm://127.0.0.1:{there.port}?model=2f85"
    asyncio.run_coroutine_threadsafe(arm.__aexit__(None, None, None), loop).result()
    loop.call_soon_threadsafe(loop.stop)
    thread.join()
    loop.close()


def test_commands(call: Call, address: str) -> None:
    call("move", "100", "--yes", address).assert_succeeded()
    status = call("status", "--json", address)
    status.assert_succeeded()
    assert abs(json.loads(status.out)["A"]["position"] - 100) <= 2
    call("doctor", address).assert_succeeded()
    call("status", address, "--device-id", "0").assert_failed(2, "device_id must be in 1..247")
    call("status", "otherarm://127.0.0.1").assert_failed(2, "no package here has otherarm://")


def test_fleet_ros_and_the_blocking_hand(address: str, tmp_path: Path) -> None:
    file = tmp_path / "FLEET.toml"
    file.write_text(f'site = "lab"\n[grippers.left]\naddress = "{address}"\n', encoding="utf-8")
    (options,) = read_agent_file(file).grippers.values()
    usual = {name: parameter.default for name, parameter in PARAMETERS.items()}
    of_node = make_hand_of_node(check_settings({**usual, "address": address}))
    assert make_served(options).address == of_node.address == address
    with RobotiqHand(address) as hand:
        assert hand.move(60).positions[JAW] == pytest.approx(60, abs=2)
