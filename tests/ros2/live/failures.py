"""A lost link, and a node that is killed."""

from __future__ import annotations

import json
import signal

from tests.ros2.live.bench import ABORTED, SUCCEEDED, Client, active
from tests.ros2.live.goals import begun
from tests.ros2.live.processes import node
from tests.ros2.live.simulated import Simulator


def test_a_killed_node_leaves_the_fingers_running(simulator: Simulator) -> None:
    """The pages warn of it. A node that is started again adopts the gripper, and can halt it."""
    with active(simulator.address) as (process, client):
        begun(client.move(2.8))
        process.send(signal.SIGKILL)
        assert process.ends() == -signal.SIGKILL
    assert simulator.request.go, "rGTO"
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("halt").success
        assert client.move(0.0).ends()[0] == SUCCEEDED


def test_a_lost_link(simulator: Simulator) -> None:
    with active(simulator.address) as (process, client):
        states, status, diagnostics = client.joint_states(), client.status(), client.diagnostics()
        goal = begun(client.move(2.8))
        simulator.lose_link()
        assert goal.ends()[0] == ABORTED
        fields = json.loads(status.wait(lambda it: not json.loads(it.data)["connected"], new=False).data)
        assert "fault" not in fields
        link, gripper = diagnostics.wait(lambda it: it.status[0].level != b"\x00").status
        assert (link.level, gripper.level) == (b"\x02", b"\x03")
        assert gripper.message == "unknown: the link is down"
        assert not gripper.values
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the link to the gripper is down")
        assert not client.call("halt").success
        simulator.find_link()
        status.wait(lambda it: json.loads(it.data)["connected"])
        states.wait()
        process.prints("the link is back, and axes that still moved were stopped")
        assert client.move(0.0).ends()[0] == SUCCEEDED
        simulator.lose_link()
        status.wait(lambda it: not json.loads(it.data)["connected"])
        assert client.change("deactivate")
        process.prints("no halt, the fingers MAY STILL MOVE")
        process.prints("no commands are taken; NOT halted")
        process.send(signal.SIGINT)
        assert process.ends() == 0
