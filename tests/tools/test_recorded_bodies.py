"""A recording has what a viewer needs to draw its gripper in 3-D, at each moment as its statuses say."""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path
from typing import Any
from xml.etree import ElementTree as ET

import numpy as np
import pytest
from mcap.reader import make_reader

from robotiq_async import RobotiqHand, RobotiqStatus
from robotiq_async.tools.description import urdf
from robotiq_async.tools.description.kinematics import joint_angles
from robotiq_async.tools.recording.feed import TRANSFORMS_S
from robotiq_async.tools.recording.recorder import Recorder
from robotiq_async.tools.recording.recordings import read_recording, recover
from robotiq_async.values.model import MODELS, model_of
from tests.tools.drawn import decoded, of_urdf, placed

Messages = dict[str, list[tuple[int, int, bytes]]]  # by topic: sequence, log time and data


def messages(file: Path) -> Messages:
    """All of a recording, read by the library of MCAP."""
    found: Messages = {}
    with file.open("rb") as stream:
        for schema, channel, message in make_reader(stream).iter_messages():
            assert schema is not None
            ros = (channel.message_encoding, schema.encoding) == ("cdr", "ros2msg")
            assert ros == (not channel.topic.startswith("/gripper/"))
            assert message.publish_time == message.log_time
            found.setdefault(channel.topic, []).append((message.sequence, message.log_time, message.data))
    return found


async def record(file: Path, model: str) -> None:
    hand = RobotiqHand(f"sim://?model={model}&speedup=10")
    async with Recorder(hand, file), hand:
        await hand.activate()
        await hand.close(speed=255)
        await hand.move(40)


@pytest.mark.parametrize("model", MODELS)
async def test_every_link_is_where_the_status_of_that_moment_has_it(model: str, tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    await record(file, model)
    found = messages(file)
    ((_, _, data),) = found["/robot_description"]
    described: str = decoded(data, "std_msgs/msg/String").data
    assert described == urdf(model)
    links = {each.attrib["name"] for each in ET.fromstring(described).findall("link")}
    joints: dict[int, Any] = {
        sequence: decoded(data, "sensor_msgs/msg/JointState") for sequence, _, data in found["/joint_states"]
    }
    statuses = {
        entry.sequence: RobotiqStatus.from_registers(
            entry.fields["registers"], timestamp=0.0, sequence=0, model=model_of(model)
        )
        for entry in read_recording(file)
        if entry.topic == "/gripper/status"
    }
    shown = set()
    for sequence, nanoseconds, data in found["/tf"]:
        state = joints[sequence]
        assert list(state.position) == list(joint_angles(statuses[sequence]))
        expected = of_urdf(described, dict(zip(state.name, state.position, strict=True)))
        drawn = placed(data)
        assert drawn.keys() == expected.keys() < links
        assert len(links - drawn.keys()) == 1, "the root has no parent"
        for link, (parent, pose) in expected.items():
            assert drawn[link].parent == parent
            np.testing.assert_allclose(drawn[link].pose, pose, atol=1e-5)  # the URDF rounds
        stamps = {(each.header.stamp.sec, each.header.stamp.nanosec) for each in transforms(data)}
        assert stamps == {divmod(nanoseconds, 10**9)}
        shown.add(tuple(state.position))
    assert len(shown) > 2, "it has moved"


def transforms(data: bytes) -> list[Any]:
    return list(decoded(data, "tf2_msgs/msg/TFMessage").transforms)


async def test_a_viewer_can_draw_from_the_first_poll_on_and_smoothly(tmp_path: Path) -> None:
    """At most 20 times a second, and never a poll later than that."""
    file = tmp_path / "it.mcap"
    await record(file, "2f85")
    found = messages(file)
    first = found["/gripper/status"][0]
    assert found["/robot_description"][0][:2] == found["/tf"][0][:2] == first[:2]
    times = [at for _, at, _ in found["/tf"]]
    assert all(after - before >= TRANSFORMS_S * 1e9 - 1000 for before, after in pairwise(times))
    polls = [at for _, at, _ in found["/gripper/status"]]
    for before, after in pairwise(times):
        due = next(at for at in polls if at - before >= TRANSFORMS_S * 1e9 - 1000)
        assert abs(after - due) <= 1000, "nanoseconds: rounding"


async def test_a_hand_that_is_started_again_is_described_once(tmp_path: Path) -> None:
    file = tmp_path / "it.mcap"
    hand = RobotiqHand("sim://?model=hand-e&speedup=20")
    async with Recorder(hand, file):
        for _ in range(2):
            async with hand:
                await hand.activate()
    found = messages(file)
    assert len(found["/robot_description"]) == 1
    assert len(found["/tf"]) > 2


async def test_a_killed_recording_is_drawn_too(tmp_path: Path) -> None:
    """The description comes first, so that it is in whatever is left."""
    file, whole = tmp_path / "it.mcap", tmp_path / "whole.mcap"
    await record(file, "3f")
    data = file.read_bytes()
    file.write_bytes(data[: len(data) // 2])
    recover(file, whole)
    found = messages(whole)
    assert found["/robot_description"]
    assert found["/tf"]


async def test_for_ros_2_there_are_joint_states_alone(tmp_path: Path) -> None:
    """There a state publisher of the user makes /tf, and two would argue."""
    file = tmp_path / "it.mcap"
    hand = RobotiqHand("sim://?speedup=20")
    async with Recorder(hand, file, ros2=True), hand:
        await hand.activate()
    assert messages(file).keys() == {"/joint_states"}
