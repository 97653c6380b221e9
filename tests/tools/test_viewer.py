"""Messages to viewers, received by a plain websocket client."""

from __future__ import annotations

import asyncio
import contextlib
import json
from collections.abc import AsyncIterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from rosbags.typesys import Stores, get_typestore

from docs import make_layout
from robotiq_async import Fault, Finger, RobotiqHand, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.description import hand_model, urdf
from robotiq_async.tools.description.kinematics import JOINTS, joint_angles, joint_names
from robotiq_async.tools.description.simulated import bodies_of
from robotiq_async.tools.errors import ViewerError
from robotiq_async.tools.recording.payloads import SCHEMAS
from robotiq_async.tools.viewer import SHOWN_TOPICS, Viewer
from robotiq_async.values.model import MODELS
from tests.foxglove_client import Client, client
from tests.grippers import active_gripper, lose_link, shows, until
from tests.patience import patience
from tests.tools.drawn import Placed, decoded, of_urdf, placed, rotation

SOCKETS = Path("/proc/net/tcp")
LINUX = SOCKETS.exists()


@contextlib.asynccontextmanager
async def viewed(hand: RobotiqHand) -> AsyncIterator[Client]:
    async with Viewer(hand, port=0) as viewer, client(viewer) as one:
        yield one


# -- what is reported --------------------------------------------------------------------------------------


@pytest.mark.skipif(not LINUX, reason="asks Linux who listens where")
async def test_it_listens_on_loopback_only(hand: RobotiqHand) -> None:
    async with Viewer(hand, port=0) as viewer:
        assert viewer.url == f"ws://127.0.0.1:{viewer.port}"
        assert [interface for interface, number in listening() if number == viewer.port] == ["0100007F"]


def listening() -> set[tuple[str, int]]:
    """Addresses at which this process listens."""
    ours = set()
    for file in Path("/proc/self/fd").iterdir():
        with contextlib.suppress(OSError):
            ours.add(str(file.readlink()))
    found = set()
    for line in SOCKETS.read_text().splitlines()[1:]:
        columns = line.split()
        interface, _, number = columns[1].partition(":")
        if columns[3] == "0A" and f"socket:[{columns[9]}]" in ours:
            found.add((interface, int(number, 16)))
    return found


async def test_every_poll_arrives(hand: RobotiqHand) -> None:
    async with viewed(hand) as client:
        await client.subscribe("/gripper/status")
        await client.until(lambda: len(client.received) >= 100)
    sequences = [each["sequence"] for each in client.objects("/gripper/status")]
    assert sequences == list(range(sequences[0], sequences[0] + 100))


async def test_the_messages_have_what_their_schema_says(hand: RobotiqHand) -> None:
    async with viewed(hand) as one:
        await one.subscribe("/gripper/status", "/gripper/command", "/gripper/event", "/gripper/state")
        await one.until(lambda: bool(one.received))
        await hand.move(100, Finger.A)
        names = ("status", "command", "event", "state")
        await one.until(lambda: all(one.objects(f"/gripper/{name}") for name in names))
    for name in names:
        channel = one.channels[f"/gripper/{name}"]
        assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
        assert json.loads(channel["schema"]) == SCHEMAS[name]
        for fields in one.objects(f"/gripper/{name}"):
            known = set(SCHEMAS[name]["properties"])  # type: ignore[call-overload]
            assert set(fields) < known if name == "event" else set(fields) == known, name


async def test_joint_states_are_read_by_another_implementation(hand: RobotiqHand) -> None:
    async with viewed(hand) as one:
        await one.subscribe("/joint_states")
        await one.until(lambda: bool(one.received))
    channel = one.channels["/joint_states"]
    assert (channel["encoding"], channel["schemaEncoding"]) == ("cdr", "ros2msg")
    _, nanoseconds, data = one.received[0]
    message: Any = get_typestore(Stores.ROS2_HUMBLE).deserialize_cdr(data, channel["schemaName"])
    assert tuple(message.name) == JOINTS
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == nanoseconds


async def test_a_late_client_gets_the_state(hand: RobotiqHand, server: SimulatorServer) -> None:
    """A gripper that is lost reports nothing more; its state is published once a second all the same."""
    await lose_link(server, hand)
    async with viewed(hand) as client:
        await client.subscribe("/gripper/state")
        await client.until(lambda: bool(client.received))
        state = client.objects("/gripper/state")[0]
        assert state["state"] == "DISCONNECTED"
        assert "fault" not in state, "unknown is left out"
        assert state["polls"] == hand.statistics.polls
        await server.accept()
        await client.until(lambda: client.objects("/gripper/state")[-1]["state"] == "RUNNING_IDLE")


async def test_the_hand_can_be_drawn(hand: RobotiqHand) -> None:
    """The description when a viewer begins to listen, and a transform for every joint of it."""
    async with viewed(hand) as one:
        await one.subscribe("/robot_description", "/tf")
        await one.until(lambda: {topic for topic, *_ in one.received} == {"/robot_description", "/tf"})
    data = next(data for topic, _, data in one.received if topic == "/robot_description")
    model = hand_model()
    assert decoded(data, "std_msgs/msg/String").data == urdf()
    shown = links(one)
    assert {(each.parent, child) for child, each in shown.items()} == {
        (joint.parent, joint.child) for joint in model.joints
    }
    assert shown.keys() | {model.root} == model.links.keys()


def links(one: Client) -> dict[str, Placed]:
    """The links as last published."""
    return placed([data for topic, _, data in one.received if topic == "/tf"][-1])


@pytest.mark.parametrize("name", ["2f85", "2f140", "hand-e"])
async def test_a_sibling_can_be_drawn(name: str) -> None:
    """Joint states name one joint: the transforms have those that follow it."""
    async with RobotiqHand(f"sim://?model={name}&speedup=20") as jaw, viewed(jaw) as one:
        await jaw.activate()
        await jaw.move(120)
        await one.subscribe("/robot_description", "/tf")
        await one.until(lambda: {topic for topic, *_ in one.received} == {"/robot_description", "/tf"})
    described = next(data for topic, _, data in one.received if topic == "/robot_description")
    text = decoded(described, "std_msgs/msg/String").data
    assert f'<robot name="{hand_model(name).name}">' in text
    angles = dict(zip(joint_names(jaw.model), joint_angles(jaw.status), strict=True))
    expected, shown = of_urdf(text, angles), links(one)
    for link, each in expected.items():
        np.testing.assert_allclose(shown[link].pose, each.pose, atol=0.02)


async def test_a_simulated_part_is_shown_where_its_simulation_has_it() -> None:
    pytest.importorskip("mujoco", reason="needs the extra physics")
    address = "sim://?model=2f85&speedup=5&physics=cylinder:40x60,0.2"
    async with RobotiqHand(address) as jaw, viewed(jaw) as one:
        await jaw.activate()
        await jaw.close()
        await one.subscribe("/gripper/parts", "/tf")
        await one.until(lambda: {topic for topic, *_ in one.received} == {"/gripper/parts", "/tf"})
        bodies = bodies_of(jaw)
        assert bodies is not None
        (entity,) = one.objects("/gripper/parts")[-1]["entities"]
        (cylinder,), (part,) = entity["cylinders"], bodies.parts
        assert entity["frame_id"] == hand_model(jaw.model).root
        assert [cylinder["size"][axis] for axis in "xyz"] == pytest.approx([0.04, 0.04, 0.06])
        assert list(cylinder["pose"]["position"].values()) == pytest.approx(part.position, abs=1e-3)
        assert entity["cubes"] == entity["spheres"] == []
        shown = links(one)
    for joint in hand_model(jaw.model).moving:
        turned = rotation(*joint.pose(bodies.joints[joint.name]).quaternion)
        np.testing.assert_allclose(shown[joint.child].pose[:3, :3], turned, atol=1e-3)


# -- beginning and end--------------------------------------------------------------------------------------


async def test_viewers_are_offered_nothing_to_call(hand: RobotiqHand) -> None:
    async with Viewer(hand, port=0) as viewer, client(viewer) as one:
        await one.subscribe("/gripper/status")
        await one.until(lambda: len(one.received) >= 20)
        assert one.services == {}
        assert one.messages[0]["capabilities"] == []


async def test_viewers_do_not_delay_the_stop() -> None:
    gripper = active_gripper(speedup=2)
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address)
        viewer = Viewer(hand, port=0)
        async with viewer, hand, client(viewer):
            _, silent = await asyncio.open_connection("127.0.0.1", viewer.port)
            await hand.set_position(255)
            await shows(hand, lambda status: status.is_moving)
            ends = asyncio.get_running_loop().time() + 5
        assert asyncio.get_running_loop().time() < ends, "nor does a client that says nothing, as a scanner"
        assert not gripper.request_registers[0] & 0x0800
        assert not gripper.is_moving
        silent.close()
        await silent.wait_closed()


@pytest.mark.skipif(not LINUX, reason="asks Linux who listens where")
async def test_cancelled_at_any_moment_it_leaves_nothing(hand: RobotiqHand) -> None:
    before = listening()

    async def use() -> None:
        async with Viewer(hand, port=0):
            pass

    for steps in range(12):
        tasks = asyncio.all_tasks()
        using = asyncio.create_task(use())
        for _ in range(steps):
            await asyncio.sleep(0)
        using.cancel()
        await asyncio.gather(using, return_exceptions=True)
        assert asyncio.all_tasks() <= tasks, f"cancelled after {steps} turns it leaves a task"
        await until(lambda: listening() == before, within=5)


async def test_a_hand_that_is_started_again_is_shown_again(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    async with Viewer(hand, port=0) as viewer, client(viewer) as one:
        await one.subscribe("/gripper/status", "/gripper/state")
        await one.until(lambda: bool(one.objects("/gripper/state")))
        assert one.objects("/gripper/state")[0]["state"] == "DISCONNECTED", "it is not started yet"
        for _ in range(2):
            async with hand:
                sequence = hand.status.sequence + 5
                while not any(each["sequence"] > sequence for each in one.objects("/gripper/status")):
                    await one.read()
        await one.until(lambda: one.objects("/gripper/state")[-1]["state"] == "SHUTDOWN")


async def test_the_state_is_published_when_it_changes(hand: RobotiqHand, gripper: SimulatedGripper) -> None:
    async with viewed(hand) as one:
        await one.subscribe("/gripper/state")
        await one.until(lambda: bool(one.received))
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await hand.wait_for_state(State.FAULT)
        faulted_at = asyncio.get_running_loop().time()
        await one.until(lambda: one.objects("/gripper/state")[-1].get("fault_code") == 14)
        assert asyncio.get_running_loop().time() - faulted_at < patience(0.5)
        assert one.objects("/gripper/state")[-1]["description"] == Fault.SCISSOR_BLOCKED.description


async def test_a_control_loop_does_not_make_the_state_the_talk_of_the_town(hand: RobotiqHand) -> None:
    async with viewed(hand) as one:
        await one.subscribe("/gripper/state", "/gripper/event")
        for position in range(50):
            await hand.set_position(position)
        await one.until(lambda: len(one.objects("/gripper/event")) >= 100)
        assert len(one.objects("/gripper/state")) < 10


async def test_a_port_that_is_taken_and_ports_that_cannot_be(hand: RobotiqHand) -> None:
    for port in (-1, 65536):
        with pytest.raises(ValueError, match="port"):
            Viewer(hand, port=port)
    assert Viewer(hand, host="::1").url == "ws://[::1]:8765"
    async with Viewer(hand, port=0) as viewer:
        with pytest.raises(ViewerError, match=f"ws://127.0.0.1:{viewer.port}: .*in use"):
            async with Viewer(hand, port=viewer.port):
                pass


# -- the layout --------------------------------------------------------------------------------------------


def test_the_layout_and_the_description_mean_the_same_hand() -> None:
    """A viewer finds the parts by the names of frames and joints, and by nothing else."""
    panel, model = make_layout.panels()["3D!hand"], hand_model()
    assert panel["followTf"] == model.root
    links = {link for kind in MODELS for link in hand_model(kind).links}
    assert set(panel["transforms"]) == {f"frame:{link}" for link in links}
    assert set(panel["topics"]) == {"/robot_description", "/gripper/parts"}


def test_the_layout_shows_what_there_is() -> None:
    """Every path is a field of a topic, every panel has its place."""
    layout = json.loads(make_layout.FILE.read_text(encoding="utf-8"))
    panels = layout["configById"]
    for config in panels.values():
        paths = [each["value"] for each in config.get("paths", ())]
        paths += [config[key] for key in ("path", "topicPath") if key in config]
        for path in paths:
            topic, *fields = path.split(".")
            schema: Any = SCHEMAS[topic.removeprefix("/gripper/")]
            for field in fields:
                schema = schema["properties"][field]

    def placed(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else placed(node["first"]) + placed(node["second"])

    assert sorted(placed(layout["layout"])) == sorted(panels)
    topics = {topic for config in panels.values() for topic in config.get("topics", ())}
    assert topics <= {topic.name for topic in SHOWN_TOPICS}
