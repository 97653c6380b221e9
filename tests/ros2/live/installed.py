"""Files of `ros2 run` and `ros2 launch`, found as they find them: through the index of ament."""

from __future__ import annotations

import os
import signal
import sys
from pathlib import Path

import pytest
from ament_index_python.packages import get_package_prefix, get_package_share_directory

from tests.ros2.live.bench import Client
from tests.ros2.live.processes import Process
from tests.ros2.live.simulated import Simulator


@pytest.fixture(autouse=True)
def index(monkeypatch: pytest.MonkeyPatch) -> None:
    """The index, as on the page: the environment is added to the paths of ROS."""
    monkeypatch.setenv("AMENT_PREFIX_PATH", f"{sys.prefix}:{os.environ.get('AMENT_PREFIX_PATH', '')}")


def test_the_executable_runs_the_node(simulator: Simulator) -> None:
    executable = Path(get_package_prefix("robotiq_async"), "lib", "robotiq_async", "gripper")
    parameters = ("-p", f"address:={simulator.address}", "-p", "autostart:=true")
    with Process("--ros-args", *parameters, program=str(executable)) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("activate").success
        process.send(signal.SIGINT)
        assert process.ends() == 0


def test_the_launch_file_is_where_launch_looks() -> None:
    """Whether launch takes it is not known: none is on the package index."""
    file = Path(get_package_share_directory("robotiq_async"), "launch", "gripper.launch.py")
    compile(file.read_text(encoding="utf-8"), str(file), "exec")
