"""A node in a process of its own, at a simulated gripper, with a client: a plugin of `make test-ros2`."""

from __future__ import annotations

from collections.abc import Iterator
from typing import NamedTuple

import pytest

from tests.ros2.live.bench import Client, active
from tests.ros2.live.processes import OF_ROS, Process, isolate
from tests.ros2.live.simulated import Simulator

isolate()


def pytest_configure(config: pytest.Config) -> None:
    """Warnings are errors but for one of ROS's own."""
    config.addinivalue_line("filterwarnings", f"ignore:{OF_ROS}:DeprecationWarning")


class Cell(NamedTuple):
    simulator: Simulator
    node: Process
    client: Client


@pytest.fixture(scope="module")
def shared() -> Iterator[Cell]:
    """An active node at an active gripper, for all tests of a file."""
    with Simulator() as simulator, active(simulator.address) as (process, client):
        yield Cell(simulator, process, client)


@pytest.fixture
def cell(shared: Cell) -> Iterator[Cell]:
    """The same, with open fingers and nothing between them; the node's log is printed."""
    began = len(shared.node.lines)
    shared.simulator.do("remove_object")
    shared.client.set("allow_stalling", True)
    shared.client.move(0.0).ends()
    yield shared
    print("".join(shared.node.lines[began:]))  # noqa: T201


@pytest.fixture
def simulator() -> Iterator[Simulator]:
    """A gripper of a test's own."""
    with Simulator() as simulator:
        yield simulator
