"""The life of the node: transitions, parameters, what is refused when, and the ends of the process."""

from __future__ import annotations

import json
import math
import signal
from typing import Any

import pytest

from robotiq_async import Finger
from robotiq_async.ros2.settings import PARAMETERS
from tests.ros2.live.bench import ABORTED, SUCCEEDED, Client, Simulator
from tests.ros2.live.goals import begun, position
from tests.ros2.live.processes import node


def writes(simulator: Simulator) -> int:
    return simulator.do(lambda gripper: len(gripper.writes))


def test_a_life(simulator: Simulator) -> None:
    with node(address=simulator.address) as process, Client() as client:
        assert client.state() == "unconfigured"
        assert "the node is not configured" in client.call("halt").message
        assert not client.change("activate"), "that is not possible yet"
        assert client.change("configure")
        process.prints("connected to tcp://127.0.0.1")
        assert client.state() == "inactive"
        client.joint_states().wait()  # also while inactive
        assert "the node is not active" in client.call("activate").message
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the node is not active")
        assert client.call("halt").success, "a halt is always taken"
        assert client.change("activate")
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: the gripper is not activated")
        assert writes(simulator) == 0, "nothing was written so far"
        assert client.call("activate").success
        goal = begun(client.move(2.8))
        assert client.change("deactivate")
        assert goal.ends()[0] == ABORTED
        process.prints("goal aborted: the node was deactivated")
        there = position(simulator)
        assert there < 230
        assert client.send(["fingers"], [0.0]) is None
        assert client.change("activate")
        assert position(simulator) == there, "activating moves nothing"
        assert client.move(0.0).ends()[0] == SUCCEEDED
        assert client.change("deactivate")
        assert client.change("cleanup")
        assert client.state() == "unconfigured"
        assert client.change("configure")
        process.prints("connected to", times=2)
        assert client.change("shutdown")
        assert client.state() == "finalized"
        process.send(signal.SIGTERM)
        assert process.ends() == 0


def test_who_only_looks_leaves_the_fingers_alone(simulator: Simulator) -> None:
    with node(address=simulator.address) as process, Client() as client:
        assert client.change("configure")
        client.joint_states().wait()
        process.send(signal.SIGINT)
        assert process.ends() == 0
    assert writes(simulator) == 0


def test_parameters(simulator: Simulator) -> None:
    with node(address="tcp://", publish_rate=20, poll_interval=7) as process, Client() as client:
        assert not client.change("configure")
        process.prints("cannot configure: malformed address 'tcp://'")
        assert client.state() == "unconfigured"
        assert client.set("address", simulator.address).successful
        assert not client.change("configure")
        process.prints("cannot configure: poll_interval must be seconds in 0.001..0.1, got 7")
        for name, value, reason in (
            ("publish_rate", "fast", "publish_rate must be a number in 1.0..200.0, got 'fast'"),
            ("speed", 256, "256"),
            ("address", "tcp://127.1", "malformed address"),
        ):
            refused = client.set(name, value)
            assert not refused.successful
            assert reason in refused.reason
        process.prints("parameter rejected: publish_rate must be a number")
        assert client.set("poll_interval", 0.01).successful
        assert client.change("configure")
        refused = client.set("address", "sim://")
        assert "address counts when the node is configured: clean it up first" in refused.reason
        assert client.set("force", 20).successful
        for name, described in zip(PARAMETERS, client.describe(*PARAMETERS), strict=True):
            assert described.description == PARAMETERS[name].description
        (rate,) = client.describe("publish_rate")
        assert (rate.floating_point_range[0].from_value, rate.floating_point_range[0].to_value) == (1, 200)
        assert process.is_running


def test_a_gripper_that_is_not_there(simulator: Simulator) -> None:
    with node(address="tcp://127.0.0.1:9", autostart=True) as process, Client() as client:
        process.prints("cannot configure: cannot connect to tcp://127.0.0.1:9")
        assert client.state() == "unconfigured"
        assert client.set("address", simulator.address).successful
        assert client.change("configure")


@pytest.mark.parametrize("number", [signal.SIGINT, signal.SIGTERM])
def test_a_signal_during_a_goal(simulator: Simulator, number: signal.Signals) -> None:
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("activate").success
        goal = begun(client.move(2.8))
        process.send(number)
        process.send(number)  # launchers send several
        assert goal.ends()[0] == ABORTED
        assert process.ends() == 0
        there = position(simulator)
        assert there < 230
        assert not simulator.do(lambda gripper: gripper.request_registers[0] >> 8 & 0x08), "rGTO"
        assert position(simulator) == there
        assert "Traceback" not in process.text


def test_a_killed_node_leaves_the_fingers_running(simulator: Simulator) -> None:
    """What the pages warn of. A node that is started again adopts the gripper, and can halt it."""
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("activate").success
        begun(client.move(2.8))
        process.send(signal.SIGKILL)
        assert process.ends() == -signal.SIGKILL
    assert simulator.do(lambda gripper: gripper.request_registers[0] >> 8 & 0x08), "rGTO"
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("halt").success
        assert client.move(0.0).ends()[0] == SUCCEEDED


def test_a_prefix_is_before_every_joint(simulator: Simulator) -> None:
    with (
        Simulator() as other,
        node(namespace="/left", address=simulator.address, autostart=True, joint_prefix="left_") as left,
        node(namespace="/right", address=other.address, autostart=True, joint_prefix="right_") as right,
        Client("/left/gripper") as one,
        Client("/right/gripper") as two,
    ):
        for process, client in ((left, one), (right, two)):
            process.prints("commands are taken")
            assert client.call("activate").success
        moving = one.move(2.8, names=["left_fingers"]), two.move(math.radians(35), names=["right_fingers"])
        assert [goal.ends()[0] for goal in moving] == [SUCCEEDED, SUCCEEDED]
        assert position(simulator) >= 238
        assert position(other) == 70
        assert one.joint_states("/left/joint_states").wait().name[0] == "left_palm_finger_1_joint"
        assert two.joint_states("/right/joint_states").wait().name[0] == "right_palm_finger_1_joint"
        assert one.send(["right_fingers"], [0.0]) is None
        left.prints("goal rejected: there is no joint 'right_fingers'")


def test_topics(simulator: Simulator, tmp_path_factory: pytest.TempPathFactory) -> None:
    urdf = tmp_path_factory.mktemp("urdf") / "hand.urdf"
    urdf.write_text("<robot name='hand'/>", encoding="utf-8")
    options: dict[str, Any] = {"urdf": str(urdf), "frame_id": "palm", "publish_rate": 100.0}
    with node(address=simulator.address, autostart=True, **options) as process, Client() as client:
        process.prints("commands are taken")
        assert client.description().wait(new=False).data == "<robot name='hand'/>"
        states = client.joint_states()
        first = states.wait()
        assert first.header.frame_id == "palm"
        assert len(first.name) == len(first.position) == len(first.velocity) == len(first.effort) == 11
        assert all(math.isnan(effort) for effort in first.effort)
        second = states.wait()
        assert second.header.stamp != first.header.stamp
        age = client.node.get_clock().now().nanoseconds / 1e9 - second.header.stamp.sec
        assert abs(age) < 5
        status = client.status()
        fields = json.loads(status.wait(new=False).data)
        assert fields["state"] == "RESET"
        assert fields["takes_commands"] is True
        diagnostics = client.diagnostics()
        link, gripper = diagnostics.wait().status
        assert (link.name, gripper.name) == ("/gripper: link", "/gripper: gripper")
        assert link.level == gripper.level == b"\x00"
        assert link.hardware_id == simulator.address
        assert client.call("activate").success
        simulator.do(lambda it: it.place_object(Finger.B, position=90))
        client.move(2.8).ends()
        fields = json.loads(status.wait().data)
        assert fields["contacts"] == ["B"]
        assert fields["B"]["status"] == "CONTACT_CLOSING"


def test_a_lost_link(simulator: Simulator) -> None:
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("activate").success
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
        assert client.move(0.0).ends()[0] == SUCCEEDED


def test_a_deactivation_without_a_link_is_told(simulator: Simulator) -> None:
    with node(address=simulator.address, autostart=True) as process, Client() as client:
        process.prints("commands are taken")
        assert client.call("activate").success
        simulator.lose_link()
        client.status().wait(lambda it: not json.loads(it.data)["connected"], new=False)
        assert client.change("deactivate")
        process.prints("no halt, the fingers MAY STILL MOVE")
        process.send(signal.SIGINT)
        assert process.ends() == 0
