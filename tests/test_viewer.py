"""What viewers get, and what they may ask: seen by a plain websocket client."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
from collections.abc import AsyncIterator
from typing import Any

import pytest
from rosbags.typesys import Stores, get_typestore
from websockets.asyncio.client import ClientConnection, connect
from websockets.exceptions import InvalidStatus
from websockets.typing import Subprotocol

from docs import make_layout
from robotiq_async import Fault, Finger, RobotiqHand, RobotiqStatus, State
from robotiq_async.actions import Operator
from robotiq_async.kinematics import JOINTS, joint_angles
from robotiq_async.payloads import SCHEMAS
from robotiq_async.services import SERVICES
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.viewer import Viewer, ViewerError

MESSAGE_DATA, CALL, ANSWER = 1, 2, 3
"""Binary operations of the protocol foxglove.sdk.v1."""


class Client:
    """Speaks the protocol by hand: no code of the server's is used."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.told: list[dict[str, Any]] = []
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self._topics: dict[int, str] = {}
        self.received: list[tuple[str, int, bytes]] = []
        self.answers: dict[int, Any] = {}

    async def read(self) -> None:
        """One frame."""
        async with asyncio.timeout(20):
            frame = await self.socket.recv()
        if isinstance(frame, str):
            said = json.loads(frame)
            self.told.append(said)
            if said["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in said["channels"]}
            elif said["op"] == "advertiseServices":
                self.services |= {service["name"]: service for service in said["services"]}
            elif said["op"] == "serviceCallFailure":
                self.answers[said["callId"]] = ValueError(said["message"])
        elif frame[0] == MESSAGE_DATA:
            number, nanoseconds = struct.unpack_from("<IQ", frame, 1)
            self.received.append((self._topics[number], nanoseconds, frame[13:]))
        elif frame[0] == ANSWER:
            _, call, length = struct.unpack_from("<III", frame, 1)
            self.answers[call] = json.loads(frame[13 + length :])["outcome"]

    async def meet(self, *, services: bool) -> None:
        while len(self.channels) < 5 or (services and not self.services):
            await self.read()

    async def subscribe(self, *topics: str) -> None:
        subscriptions = []
        for topic in topics:
            number = len(self._topics) + 1
            self._topics[number] = topic
            subscriptions.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))

    async def ask(self, number: int, name: str, arguments: object) -> None:
        service, payload = self.services[f"/gripper/{name}"]["id"], json.dumps(arguments).encode()
        await self.socket.send(struct.pack("<BIII", CALL, service, number, 4) + b"json" + payload)

    async def answer(self, number: int) -> str:
        while number not in self.answers:
            await self.read()
        answer = self.answers.pop(number)
        if isinstance(answer, Exception):
            raise answer
        return str(answer)

    async def call(self, name: str, **arguments: object) -> str:
        await self.ask(99, name, arguments)
        return await self.answer(99)

    def objects(self, topic: str) -> list[dict[str, Any]]:
        return [json.loads(data) for where, _, data in self.received if where == topic]


@pytest.fixture
async def gripper() -> SimulatedGripper:
    return SimulatedGripper(speedup=20)


@pytest.fixture
async def server(gripper: SimulatedGripper) -> AsyncIterator[SimulatorServer]:
    async with SimulatorServer(gripper) as server:
        yield server


@pytest.fixture
async def operator(server: SimulatorServer) -> AsyncIterator[Operator]:
    async with RobotiqHand(server.address) as hand:
        yield Operator(hand)


@contextlib.asynccontextmanager
async def client(viewer: Viewer, *, services: bool = True) -> AsyncIterator[Client]:
    subprotocols = [Subprotocol("foxglove.sdk.v1")]
    # A queue that is full would keep the client from hearing that the connection closes.
    async with connect(viewer.url, subprotocols=subprotocols, max_queue=None) as socket:
        client = Client(socket)
        await client.meet(services=services)
        yield client


@contextlib.asynccontextmanager
async def viewed(operator: Operator) -> AsyncIterator[Client]:
    async with Viewer(operator.hand, port=0, operator=operator) as viewer, client(viewer) as one:
        yield one


# -- what is told ------------------------------------------------------------------------------------------


async def test_it_listens_on_loopback_only(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        assert viewer.url == f"ws://127.0.0.1:{viewer.port}"
        assert viewer.port > 0


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
        while not any(each.get("code") == 14 for each in client.objects("/gripper/event")):
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
        assert (state["state"], state["fault"]) == ("DISCONNECTED", 0)
        assert state["polls"] == operator.hand.statistics.polls
        await server.accept()
        while client.objects("/gripper/state")[-1]["state"] != "RUNNING_IDLE":
            await client.read()


async def test_an_older_client_is_refused(operator: Operator) -> None:
    async with Viewer(operator.hand, port=0) as viewer:
        with pytest.raises(InvalidStatus, match="400"):
            await connect(viewer.url, subprotocols=[Subprotocol("foxglove.websocket.v1")])


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
        SimulatorServer(SimulatedGripper(speedup=4)) as slow,
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
    async with SimulatorServer(SimulatedGripper(speedup=4)) as slow, RobotiqHand(slow.address) as hand:
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
    buttons = {config["serviceName"] for config in panels.values() if "serviceName" in config}
    assert buttons == set(SERVICES) - {"/gripper/set_speed", "/gripper/set_force"}
