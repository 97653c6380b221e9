"""Topics of the node, alone and beside another one."""

from __future__ import annotations

import json
import math
from typing import Any

import pytest
from std_msgs.msg import String

from robotiq_async import Finger
from robotiq_async.ros2.translation.description import robot_description
from tests.ros2.live.bench import LATEST, SUCCEEDED, Client, active
from tests.ros2.live.goals import position
from tests.ros2.live.processes import node
from tests.ros2.live.simulated import Simulator


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
        described = one.listen(String, "/left/robot_description", LATEST).wait(new=False).data
        assert described == robot_description("", "left_")
        assert one.joint_states("/left/joint_states").wait().name[0] == "left_palm_finger_1_joint"
        assert two.joint_states("/right/joint_states").wait().name[0] == "right_palm_finger_1_joint"
        assert one.send(["right_fingers"], [0.0]) is None
        left.prints("goal rejected: there is no joint 'right_fingers'")


def test_a_jaw_has_one_joint() -> None:
    with Simulator(model="2f85") as jaw, active(jaw.address) as (process, client):
        described = client.listen(String, "/robot_description", LATEST).wait(new=False).data
        assert described == robot_description("", "", "2f85")
        status, result = client.move(0.8, names=["robotiq_85_left_knuckle_joint"]).ends()
        assert status == SUCCEEDED
        assert list(result.state.name) == ["robotiq_85_left_knuckle_joint"]
        assert result.state.position[0] == pytest.approx(0.7929, abs=0.01)
        state = client.joint_states().wait()
        assert len(state.name) == len(state.position) == len(state.velocity) == len(state.effort) == 1
        assert client.send(["fingers"], [0.0]) is None
        process.prints("goal rejected: there is no joint 'fingers'; these take goals: robotiq_85_left_kn")


def test_topics(simulator: Simulator, tmp_path_factory: pytest.TempPathFactory) -> None:
    urdf = tmp_path_factory.mktemp("urdf") / "hand.urdf"
    urdf.write_text("<robot name='hand'/>", encoding="utf-8")
    options: dict[str, Any] = {"urdf": str(urdf), "frame_id": "palm", "publish_rate": 100.0}
    with node(address=simulator.address, autostart=True, **options) as process, Client() as client:
        process.prints("commands are taken")
        assert (
            client.listen(String, "/robot_description", LATEST).wait(new=False).data == "<robot name='hand'/>"
        )
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
        # It is published ten times a second: the one before the node was activated may still come.
        taking = status.wait(lambda it: json.loads(it.data)["takes_commands"], new=False)
        assert json.loads(taking.data)["state"] == "RESET"
        diagnostics = client.diagnostics()
        link, gripper = diagnostics.wait().status
        assert (link.name, gripper.name) == ("/gripper: link", "/gripper: gripper")
        assert link.level == gripper.level == b"\x00"
        assert link.hardware_id == simulator.address
        assert client.call("activate").success
        simulator.do("place_object", Finger.B, position=90)
        client.move(2.8).ends()
        fields = json.loads(status.wait().data)
        assert fields["contacts"] == ["B"]
        assert fields["B"]["axis_state"] == "CONTACT_CLOSING"
