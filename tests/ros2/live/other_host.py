"""A hand on another host: the node at an agent, over zenoh on loopback."""

from __future__ import annotations

import json
import signal
import socket

import pytest

from tests.ros2.live.bench import ABORTED, CANCELED, SUCCEEDED, active
from tests.ros2.live.goals import begun, position
from tests.ros2.live.processes import Process
from tests.ros2.live.simulated import Simulator

pytest.importorskip("zenoh")


def agent(endpoint: str, simulator: Simulator) -> Process:
    """An agent that serves a gripper as zenoh://lab/cell/left; it is ready."""
    process = Process("-m", "tests.fleet.programs", "agent", endpoint, simulator.address)
    process.prints("ready")
    return process


def test_goals_a_halt_and_an_agent_that_is_killed(simulator: Simulator) -> None:
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        endpoint = f"tcp/127.0.0.1:{free.getsockname()[1]}"
    address = f"zenoh://lab/cell/left?connect={endpoint}&insecure=1"
    with agent(endpoint, simulator) as served, active(address) as (process, client):
        assert client.move(0.5).ends()[0] == SUCCEEDED
        goal = begun(client.move(2.8))
        goal.cancel()
        assert goal.ends()[0] == CANCELED
        assert client.move(0.5).ends()[0] == SUCCEEDED  # the whole way again, however late it was canceled
        goal = begun(client.move(2.8))
        assert client.call("halt").success
        there = position(simulator)
        assert goal.ends()[0] == ABORTED
        assert position(simulator) == there < 230
        assert client.move(0.0).ends()[0] == SUCCEEDED
        status = client.status()
        goal = begun(client.move(2.8))
        served.send(signal.SIGKILL)
        assert goal.ends()[0] == ABORTED
        status.wait(lambda it: not json.loads(it.data)["connected"], new=False)
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the link to the gripper is down")
        assert not client.call("halt").success
        with agent(endpoint, simulator):
            status.wait(lambda it: json.loads(it.data)["connected"])
            assert client.call("halt").success
            assert client.change("deactivate")
            process.send(signal.SIGINT)
            assert process.ends() == 0
