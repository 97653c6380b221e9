"""What viewers get, and what they may ask: seen by a plain websocket client."""

from __future__ import annotations

import asyncio
import contextlib
import json
import socket
import xml.etree.ElementTree as ET
from collections.abc import AsyncIterator, Iterator
from pathlib import Path
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore
from websockets.asyncio.client import connect
from websockets.exceptions import ConnectionClosed, InvalidStatus
from websockets.typing import Origin, Subprotocol

from docs import make_layout
from robotiq_async import Fault, Finger, RobotiqHand, RobotiqStatus, State
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.tools.actions import Operator
from robotiq_async.tools.description import HandModel, urdf
from robotiq_async.tools.description.kinematics import JOINTS, joint_angles
from robotiq_async.tools.description.robot_description import transforms
from robotiq_async.tools.recording.payloads import SCHEMAS
from robotiq_async.tools.viewer.gate import Gate
from robotiq_async.tools.viewer.services import SERVICES
from robotiq_async.tools.viewer.viewer import SHOWN, Viewer
from robotiq_async.values.errors import ViewerError
from tests.foxglove_client import Client, client
from tests.grippers import active_gripper

PROTOCOLS = [Subprotocol("foxglove.sdk.v1")]
SOCKETS = Path("/proc/net/tcp")
LINUX = SOCKETS.exists()


@pytest.fixture
async def operator(hand: RobotiqHand) -> Operator:
    return Operator(hand)


@contextlib.asynccontextmanager
async def viewed(operator: Operator) -> AsyncIterator[Client]:
    async with Viewer(operator.hand, port=0, operator=operator) as viewer, client(viewer) as one:
        yield one


# -- what is told ------------------------------------------------------------------------------------------


@pytest.mark.skipif(not LINUX, reason="asks Linux who listens where")
async def test_it_listens_on_loopback_only(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        assert viewer.url == f"ws://127.0.0.1:{viewer.port}"
        assert listeners(viewer.port) == ["0100007F"]
    await closed(viewer.port)


async def closed(port: int) -> None:
    """Nobody listens any more; the server's own threads may need a moment for that."""
    async with asyncio.timeout(5):
        while listeners(port):  # noqa: ASYNC110
            await asyncio.sleep(0.01)


def listeners(port: int) -> list[str]:
    """The interfaces on which this process listens on a port, as Linux writes them."""
    return [interface for interface, number in listening() if number == port]


def listening() -> set[tuple[str, int]]:
    """Where this process listens."""
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


async def test_the_topics_are_described(operator: Operator) -> None:
    async with viewed(operator) as client:
        for name in ("status", "command", "event", "state"):
            channel = client.channels[f"/gripper/{name}"]
            assert (channel["encoding"], channel["schemaEncoding"]) == ("json", "jsonschema")
            assert json.loads(channel["schema"]) == SCHEMAS[name]
        joints = client.channels["/joint_states"]
        assert (joints["encoding"], joints["schemaName"]) == ("cdr", "sensor_msgs/msg/JointState")
        assert joints["schemaEncoding"] == "ros2msg"


async def test_every_poll_arrives(operator: Operator) -> None:
    async with viewed(operator) as client:
        await client.subscribe("/gripper/status")
        while len(client.received) < 200:
            await client.read()
    sequences = [each["sequence"] for each in client.objects("/gripper/status")]
    assert sequences == list(range(sequences[0], sequences[0] + 200))


async def test_the_messages_have_what_their_schema_says(operator: Operator) -> None:
    async with viewed(operator) as client:
        await client.subscribe("/gripper/status", "/gripper/command", "/gripper/event", "/gripper/state")
        while not client.received:
            await client.read()
        await operator.move(100, Finger.A)
        while not all(client.objects(f"/gripper/{name}") for name in ("status", "command", "event", "state")):
            await client.read()
    for name in ("status", "command", "state"):
        for fields in client.objects(f"/gripper/{name}"):
            assert set(fields) == set(SCHEMAS[name]["properties"]), name  # type: ignore[call-overload]
    for fields in client.objects("/gripper/event"):
        assert set(fields) < set(SCHEMAS["event"]["properties"])  # type: ignore[call-overload]


async def test_joint_states_are_read_by_another_implementation(operator: Operator) -> None:
    store = get_typestore(Stores.ROS2_HUMBLE)
    async with viewed(operator) as client:
        await operator.move(150, Finger.ABC)
        await client.subscribe("/joint_states")
        while not client.received:
            await client.read()
    _, nanoseconds, data = client.received[0]
    message: Any = store.deserialize_cdr(data, "sensor_msgs/msg/JointState")
    assert tuple(message.name) == JOINTS
    assert list(message.position) == pytest.approx(joint_angles(operator.hand.status))
    assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == nanoseconds


async def test_events_commands_and_faults(operator: Operator, gripper: SimulatedGripper) -> None:
    async with viewed(operator) as client:
        await client.subscribe("/gripper/event", "/gripper/command")
        assert (await client.call("move", position=77, fingers="B")).startswith("B at 77; ")
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        while not any(each.get("fault_code") == 14 for each in client.objects("/gripper/event")):
            await client.read()
        while not any(each.get("target") == "FAULT" for each in client.objects("/gripper/event")):
            await client.read()
    assert client.objects("/gripper/command")[0]["B"]["position"] == 77


async def test_whoever_comes_late_is_told_the_state(operator: Operator, server: SimulatorServer) -> None:
    """A gripper that is lost tells nothing more; its state is told once a second all the same."""
    server.refuse()
    server.cut()
    await operator.hand.wait_for_state(State.DISCONNECTED)
    async with viewed(operator) as client:
        await client.subscribe("/gripper/state")
        while not client.received:
            await client.read()
        state = client.objects("/gripper/state")[0]
        assert state["state"] == "DISCONNECTED"
        assert "fault" not in state, "what is not known is not told"
        assert state["polls"] == operator.hand.statistics.polls
        await server.accept()
        while client.objects("/gripper/state")[-1]["state"] != "RUNNING_IDLE":
            await client.read()


async def test_an_older_client_is_refused(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        with pytest.raises(InvalidStatus, match="400"):
            await connect(viewer.url, subprotocols=[Subprotocol("foxglove.websocket.v1")])


@pytest.mark.parametrize("origin", ["http://evil.example", "null", "http://localhost:1", "file://"])
async def test_a_page_of_another_site_is_refused(operator: Operator, origin: str) -> None:
    async with Viewer(operator.hand, port=0, operator=operator) as viewer:
        with pytest.raises(InvalidStatus, match="403"):
            await connect(viewer.url, subprotocols=PROTOCOLS, origin=Origin(origin))
        both = [("Origin", "https://app.foxglove.dev"), ("Origin", origin)]
        with pytest.raises(InvalidStatus, match="403"):  # one for each who looks
            await connect(viewer.url, subprotocols=PROTOCOLS, additional_headers=both)


async def test_the_viewers_own_site_is_let_in_and_programs_are(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        for origin in (None, Origin("https://app.foxglove.dev")):
            async with connect(viewer.url, subprotocols=PROTOCOLS, origin=origin, max_queue=None) as socket:
                await Client(socket).meet(services=False)


@pytest.mark.skipif(not LINUX, reason="asks Linux who listens where")
async def test_the_server_behind_is_not_where_pages_look(operator: Operator) -> None:
    before = listening()
    async with Viewer(operator.hand, port=0) as viewer:
        others = {interface for interface, port in listening() - before if port != viewer.port}
    assert len(others) == 1
    assert not others & {"0100007F", "00000000"}
    assert all(interface.endswith("7F") for interface in others)


async def test_only_websockets_pass(operator: Operator) -> None:
    """After another request a second one could come, which the gate does not look at."""
    async with Viewer(operator.hand, port=0) as viewer:
        reader, writer = await asyncio.open_connection("127.0.0.1", viewer.port)
        writer.write(b"GET / HTTP/1.1\r\nHost: x\r\n\r\n")
        async with asyncio.timeout(5):
            assert (await reader.read()).startswith(b"HTTP/1.1 403")
        writer.close()
        await writer.wait_closed()


async def test_who_says_no_end_of_things_is_sent_away(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        reader, writer = await asyncio.open_connection("127.0.0.1", viewer.port)
        writer.write(b"GET / HTTP/1.1\r\n" + b"X: " + b"y" * 30_000)
        async with asyncio.timeout(5):
            with contextlib.suppress(ConnectionError):
                assert await reader.read() == b""
        writer.close()
        with contextlib.suppress(ConnectionError):
            await writer.wait_closed()


@contextlib.contextmanager
def gate(told: list[str], *, head_s: float = 10.0) -> Iterator[tuple[str, int]]:
    """Where a gate listens, with nothing behind it."""
    one = Gate(
        "127.0.0.1", 0, ("127.0.0.1", 1), origins=(), refused=told.append, left=lambda: None, head_s=head_s
    )
    try:
        yield "127.0.0.1", one.port
    finally:
        one.stop()


def test_who_says_what_he_wants_in_drops_is_sent_away() -> None:
    """Each drop in time: 64 of them kept everybody else out for as long as they liked."""
    with gate([], head_s=0.2) as where, socket.create_connection(where, 5) as client:
        client.settimeout(0.02)
        with contextlib.suppress(ConnectionError):
            for _ in range(500):
                client.sendall(b"x")
                with contextlib.suppress(TimeoutError):
                    assert client.recv(1) == b""
                    return
            pytest.fail("he still drips")


def test_an_origin_is_told_of_once() -> None:
    """A page may try again as often as it likes: it fills nobody's terminal."""
    told: list[str] = []
    with gate(told) as where:
        for number in (0, 0, 0, *range(100)):
            with socket.create_connection(where, 5) as client:
                head = f"GET / HTTP/1.1\r\nUpgrade: websocket\r\nOrigin: http://evil{number}\r\n\r\n"
                client.sendall(head.encode())
                assert client.recv(12) == b"HTTP/1.1 403"
    assert told == [f"http://evil{number}" for number in range(32)]


async def test_a_viewer_that_leaves_holds_what_moves() -> None:
    async with SimulatorServer(active_gripper()) as slow, RobotiqHand(slow.address) as hand:
        viewer = Viewer(hand, port=0, operator=Operator(hand))
        async with viewer:
            async with client(viewer) as one:
                await one.ask(1, "close", {})
                await seen(hand, moving=True)
            status = await seen(hand, moving=False)
            assert status.position(Finger.A) < 200


async def test_the_hand_can_be_drawn(operator: Operator) -> None:
    """The description when somebody begins to listen, and a transform for every joint of it."""
    store = get_typestore(Stores.ROS2_HUMBLE)
    async with viewed(operator) as one:
        await one.subscribe("/robot_description", "/tf")
        while not one.objects("/tf") or not any(
            topic == "/robot_description" for topic, _, _ in one.received
        ):
            await one.read()
    data = next(data for topic, _, data in one.received if topic == "/robot_description")
    message: Any = store.deserialize_cdr(data, "std_msgs/msg/String")
    model = HandModel.parse(message.data)
    placed = {model.root: (0.0, 0.0, 0.0)}
    told = {each["child_frame_id"]: each for each in one.objects("/tf")[-1]["transforms"]}
    assert {(each["parent_frame_id"], child) for child, each in told.items()} == {
        (joint.parent, joint.child) for joint in model.joints
    }
    assert len(placed | told) == len(model.links)


# -- what is asked -----------------------------------------------------------------------------------------


async def test_every_service_is_offered_with_its_arguments(operator: Operator) -> None:
    async with viewed(operator) as client:
        assert set(client.services) == set(SERVICES)
        request = client.services["/gripper/move"]["request"]
        assert json.loads(request["schema"]) == SERVICES["/gripper/move"].schema


async def test_without_an_operator_there_are_no_services(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer, client(viewer, services=False) as one:
        await one.subscribe("/gripper/status")
        while len(one.received) < 20:
            await one.read()
        assert one.services == {}
        assert one.told[0]["capabilities"] == []


async def test_a_refusal_says_why(operator: Operator) -> None:
    async with viewed(operator) as client:
        with pytest.raises(ValueError, match=r"position must be in 0\.\.255, got 256"):
            await client.call("move", position=256)
        with pytest.raises(ValueError, match=r"reset needs confirm = true: .*DROPS"):
            await client.call("reset", confirm=False)
        with pytest.raises(ValueError, match="InvalidStateError"):
            await client.call("release", confirm=True)
        assert not operator.has_moved


async def test_a_halt_does_not_wait_for_a_move() -> None:
    async with (
        SimulatorServer(active_gripper()) as slow,
        RobotiqHand(slow.address) as hand,
        viewed(Operator(hand)) as client,
    ):
        await client.ask(1, "close", {})
        await hand.wait_for_state(State.RUNNING_CC)
        assert await client.call("halt") == "every axis stands still"
        with pytest.raises(ValueError, match="MoveSupersededError"):
            await client.answer(1)
        assert hand.status.position(Finger.A) < 200


async def test_leaving_holds_what_a_viewer_has_set_in_motion() -> None:
    async with SimulatorServer(active_gripper()) as slow, RobotiqHand(slow.address) as hand:
        operator = Operator(hand)
        async with viewed(operator) as one:
            await one.ask(1, "close", {})
            await seen(hand, moving=True)
        status = await seen(hand, moving=False)
        assert status.position(Finger.A) < 200
        assert operator.has_moved


async def seen(hand: RobotiqHand, *, moving: bool) -> RobotiqStatus:
    async with asyncio.timeout(20):
        async for status in hand.statuses():
            if status.is_moving is moving:
                return status
    raise AssertionError("the hand has ended")


async def test_a_client_that_says_nothing_does_not_keep_the_viewer(operator: Operator) -> None:
    """nc, a scanner of ports, a browser that connects in advance."""
    async with Viewer(operator.hand, port=0) as viewer:
        _, silent = await asyncio.open_connection("127.0.0.1", viewer.port)
        began = asyncio.get_running_loop().time()
    assert asyncio.get_running_loop().time() - began < 5
    silent.close()
    await silent.wait_closed()


async def test_nothing_that_concerns_viewers_delays_the_stop() -> None:
    gripper = active_gripper(speedup=2)
    async with SimulatorServer(gripper) as server:
        hand = RobotiqHand(server.address)
        viewer = Viewer(hand, port=0, operator=Operator(hand))
        async with viewer, hand, client(viewer) as one:
            _, silent = await asyncio.open_connection("127.0.0.1", viewer.port)
            await one.ask(1, "close", {})
            await seen(hand, moving=True)
        assert not gripper.request_registers[0] & 0x0800
        assert not gripper.is_moving
        silent.close()
        await silent.wait_closed()


async def test_calls_that_come_while_it_is_left_move_nothing() -> None:
    async with SimulatorServer(active_gripper()) as slow, RobotiqHand(slow.address) as hand:
        operator = Operator(hand)
        async with Viewer(hand, port=0, operator=operator) as viewer:
            connection = await connect(
                viewer.url, subprotocols=[Subprotocol("foxglove.sdk.v1")], max_queue=None
            )
            one = Client(connection)
            await one.meet(services=True)

            async def insist() -> None:
                with contextlib.suppress(ConnectionClosed):
                    for number in range(1000):
                        await one.ask(number, "close", {})
                        await asyncio.sleep(0)

            insisting = asyncio.create_task(insist())
            await seen(hand, moving=True)
        assert not viewer._calls
        await seen(hand, moving=False)
        requests = hand.requests()
        await insisting
        await connection.close()
        for _ in range(20):
            await anext(hand.statuses())
        assert requests.take_nowait() is None
        assert not hand.is_moving


@pytest.mark.skipif(not LINUX, reason="asks Linux who listens where")
@pytest.mark.parametrize("steps", range(12))
async def test_cancelled_at_any_moment_it_leaves_nothing(operator: Operator, steps: int) -> None:
    before = listening()

    async def use() -> None:
        async with Viewer(operator.hand, port=0, operator=operator):
            pass

    using = asyncio.create_task(use())
    for _ in range(steps):
        await asyncio.sleep(0)
    using.cancel()
    await asyncio.gather(using, return_exceptions=True)
    async with asyncio.timeout(5):
        while listening() != before:  # noqa: ASYNC110
            await asyncio.sleep(0.01)


async def test_what_comes_after_the_end_is_refused(operator: Operator) -> None:
    viewer = Viewer(operator.hand, port=0, operator=operator)
    async with viewer:
        pass
    with pytest.raises(ViewerError, match="no more calls are accepted"):
        await viewer._serve(SERVICES["/gripper/close"], b"{}")
    assert not operator.has_moved


async def test_a_hand_that_is_started_again_is_shown_again(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    async with Viewer(hand, port=0) as viewer, client(viewer, services=False) as one:
        await one.subscribe("/gripper/status", "/gripper/state")
        while not one.objects("/gripper/state"):
            await one.read()
        assert one.objects("/gripper/state")[0]["state"] == "DISCONNECTED", "it is not started yet"
        for _ in range(2):
            async with hand:
                sequence = hand.status.sequence + 5
                while not any(each["sequence"] > sequence for each in one.objects("/gripper/status")):
                    await one.read()
        while one.objects("/gripper/state")[-1]["state"] != "SHUTDOWN":
            await one.read()


async def test_the_state_is_told_when_it_changes(operator: Operator, gripper: SimulatedGripper) -> None:
    async with viewed(operator) as one:
        await one.subscribe("/gripper/state")
        while not one.received:
            await one.read()
        gripper.inject_fault(Fault.SCISSOR_BLOCKED)
        await operator.hand.wait_for_state(State.FAULT)
        told = asyncio.get_running_loop().time()
        while one.objects("/gripper/state")[-1].get("fault_code") != 14:
            await one.read()
        assert asyncio.get_running_loop().time() - told < 0.5
        assert one.objects("/gripper/state")[-1]["description"] == Fault.SCISSOR_BLOCKED.description


async def test_a_control_loop_does_not_make_the_state_the_talk_of_the_town(operator: Operator) -> None:
    async with viewed(operator) as one:
        await one.subscribe("/gripper/state", "/gripper/event")
        for position in range(100):
            await operator.hand.set_position(position)
        while len(one.objects("/gripper/event")) < 200:
            await one.read()
        assert len(one.objects("/gripper/state")) < 20


async def test_a_request_of_megabytes_is_refused_unread(operator: Operator) -> None:
    async with viewed(operator) as one:
        with pytest.raises(ValueError, match="4096 bytes at most") as error:
            await one.call("move", position=[1] * 2_000_000)
        assert len(str(error.value)) < 200
        assert not operator.has_moved


async def test_a_halt_finds_its_way_through_a_crowd() -> None:
    async with SimulatorServer(active_gripper()) as slow, RobotiqHand(slow.address) as hand:
        slow.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
        await hand.wait_for_state(State.FAULT)
        async with viewed(Operator(hand)) as one:
            for number in range(20):
                await one.ask(number, "recover", {"confirm": True})
            while len(one.answers) < 4:
                await one.read()
            assert all("16 calls are in progress" in str(answer) for answer in one.answers.values())
            assert await one.call("halt") == "every axis stands still"


async def test_an_operator_of_another_hand_is_refused(operator: Operator) -> None:
    with pytest.raises(ValueError, match="operator must have <RobotiqHand"):
        Viewer(RobotiqHand(), operator=operator)


def test_an_address_of_the_sixth_version_has_brackets() -> None:
    assert Viewer(RobotiqHand(), host="::1").url == "ws://[::1]:8765"


async def test_a_port_that_is_taken(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        with pytest.raises(ViewerError, match=f"ws://127.0.0.1:{viewer.port}: .*in use"):
            async with Viewer(operator.hand, port=viewer.port):
                pass


@pytest.mark.parametrize("port", [-1, 65536])
async def test_a_port_that_cannot_be(operator: Operator, port: int) -> None:
    with pytest.raises(ValueError, match="port"):
        Viewer(operator.hand, port=port)


# -- the layout --------------------------------------------------------------------------------------------


def test_the_layout_the_transforms_and_the_description_mean_the_same_hand() -> None:
    """A viewer finds the parts by the names of frames and joints, and by nothing else."""
    panel = make_layout.panels()["3D!hand"]
    robot = ET.fromstring(urdf())
    links = {each.attrib["name"] for each in robot.findall("link")}
    joints = {
        each.attrib["name"]: (each[0].attrib["link"], each[1].attrib["link"])  # parent and child
        for each in robot.findall("joint")
    }
    status = RobotiqStatus.from_registers([0] * 8, timestamp=0.0, sequence=0)
    told = transforms(status, 0)["transforms"]
    assert {(each["parent_frame_id"], each["child_frame_id"]) for each in told} == set(joints.values())
    assert {panel["followTf"]} == links - {child for _, child in joints.values()}
    assert set(panel["transforms"]) == {f"frame:{link}" for link in links}
    assert set(panel["topics"]) == {"/robot_description"}
    moving = {each.attrib["name"] for each in robot.findall("joint") if each.attrib["type"] == "revolute"}
    assert moving == set(JOINTS)


def test_the_layout_shows_what_there_is() -> None:
    """Every path is a field of a topic, every button a service, every panel has its place."""
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
        if "serviceName" in config:
            service, request = SERVICES[config["serviceName"]], json.loads(config["requestPayload"])
            assert set(service.required) <= set(request) <= set(service.arguments)
            assert request.get("confirm", False) is False, "a person confirms, not the layout"

    def placed(node: Any) -> list[str]:
        return [node] if isinstance(node, str) else placed(node["first"]) + placed(node["second"])

    assert sorted(placed(layout["layout"])) == sorted(panels)
    topics = {topic for config in panels.values() for topic in config.get("topics", ())}
    assert topics <= {topic.name for topic in SHOWN}
    buttons = {config["serviceName"] for config in panels.values() if "serviceName" in config}
    assert buttons == set(SERVICES) - {"/gripper/set_speed", "/gripper/set_force"}
