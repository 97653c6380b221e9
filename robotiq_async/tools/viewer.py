"""Shows a hand in Foxglove and Lichtblick while it works. Needs the extra ``view`` (foxglove-sdk).

    hand = RobotiqHand(address)
    async with Viewer(hand), hand:
        ...

In this order a slow viewer does not delay the stop of the hand.

The topics are as in a recording (:mod:`.recording.feed`); ``/gripper/state`` with state, fault and
statistics, once a second and at every event; and ``/gripper/parts`` with the parts that a simulation with
physics has before the gripper. Viewers only look: there is no password, and nothing here moves the gripper.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable, Sequence
from typing import Any, Final, Self

try:
    import foxglove
    from foxglove import Channel, Context, Schema
    from foxglove.websocket import ChannelView, Client, ServerListener, WebSocketServer
except ModuleNotFoundError as error:
    from ..runtime import install

    raise ImportError(f"viewers need foxglove-sdk: {install('view')}") from error

from ..hands import Hand
from ..runtime import in_a_thread, now, wait_shielded
from ..values import State, check_int
from .description import Pose, Shape, hand_model
from .description.simulated import bodies_of, joints_and_parts
from .description.transforms import encode_description
from .errors import ViewerError
from .recording.feed import DESCRIPTION, EVENT, TOPICS, TRANSFORMS, Feed, Message, Topic, compact, json_topic
from .recording.payloads import INTEGER, NUMBER, SCHEMAS, STRING, object_schema, state_fields, title

LOOPBACK: Final = "127.0.0.1"
VIEWER_PORT: Final = 8765
"""The default of Foxglove's own dialog."""
STATE_TOPIC: Final = json_topic("state", SCHEMAS["state"])
_TIME: Final = {"title": "time", **object_schema(sec=INTEGER, nsec=INTEGER)}
_XYZ: Final = object_schema(**dict.fromkeys("xyz", NUMBER))
_QUATERNION: Final = object_schema(**dict.fromkeys("xyzw", NUMBER))
_SOLID: Final = object_schema(
    pose=object_schema(position=_XYZ, orientation=_QUATERNION),
    size=_XYZ,
    color=object_schema(**dict.fromkeys("rgba", NUMBER)),
    bottom_scale=NUMBER,
    top_scale=NUMBER,
)
_SOLIDS: Final = {"box": "cubes", "cylinder": "cylinders", "sphere": "spheres"}
_ENTITY: Final = object_schema(
    timestamp=_TIME,
    frame_id=STRING,
    id=STRING,
    frame_locked={"type": "boolean"},
    **{name: {"type": "array", "items": _SOLID} for name in _SOLIDS.values()},
)
_SCENE_SCHEMA: Final = json.dumps(object_schema(entities={"type": "array", "items": _ENTITY})).encode()
PARTS: Final = Topic("/gripper/parts", "json", "foxglove.SceneUpdate", "jsonschema", _SCENE_SCHEMA)
_YELLOW: Final = {"r": 0.95, "g": 0.76, "b": 0.19, "a": 1.0}
SHOWN_TOPICS: Final = (*TOPICS, STATE_TOPIC, PARTS)
STATE_S: Final = 1.0
"""Interval of ``/gripper/state`` when nothing happens."""
VIEWER_STOP_S: Final = 1.0
"""Time for the server to close its connections; a client that does not read could delay it for ever."""


class Viewer:
    """Serves a hand to viewers during a block.

    Attributes:
        host: the interface to listen on.
        port: the TCP port; 0 takes a free one, which ``port`` names once the viewer serves.

    Raises:
        TypeError: port is not an int.
        ValueError: port is outside 0..65535.
    """

    def __init__(self, hand: Hand, *, host: str = LOOPBACK, port: int = VIEWER_PORT) -> None:
        self.host = host
        self.port: int = check_int("port", port, 0, 65535)
        self._hand = hand
        self._feed = Feed(hand, self._publish)
        self._server: WebSocketServer
        self._context: Context
        """A reference: its channels close with the last one."""
        self._channels: dict[Topic, Channel] = {}
        self._publisher: asyncio.Task[None]
        self._published_state: State | None = None

    @property
    def url(self) -> str:
        """The address to open in a viewer."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws://{host}:{self.port}"

    async def __aenter__(self) -> Self:
        """Listen and start publishing.

        Raises:
            ViewerError: the port is taken, or the interface does not exist.
        """
        self._context = Context()
        self._channels = {topic: _channel(topic, self._context) for topic in SHOWN_TOPICS}
        starting = in_a_thread(self._start_server)
        try:
            await wait_shielded(starting)
        except asyncio.CancelledError:
            if starting.exception() is None:
                self._server = starting.result()
                await wait_shielded(asyncio.ensure_future(self._stop_server()))
            raise
        try:
            self._server = starting.result()
        except (RuntimeError, OSError, ValueError) as error:
            raise ViewerError(f"{self.url}: {error}") from error
        self.port = self._server.port
        self._feed.start()
        loop = asyncio.get_running_loop()
        self._publisher = loop.create_task(self._publish_periodically(), name="robotiq_async viewer")
        return self

    async def __aexit__(self, *_: object) -> None:
        await wait_shielded(asyncio.ensure_future(self._close()))

    async def _close(self) -> None:
        self._publisher.cancel()
        await asyncio.gather(self._publisher, return_exceptions=True)
        await self._feed.stop()
        await self._stop_server()

    def _start_server(self) -> WebSocketServer:
        return foxglove.start_server(
            name=f"robotiq_async: {title(self._hand)}",
            host=self.host,
            port=self.port,
            server_listener=_SubscriptionListener(self._describe),
            context=self._context,
        )

    async def _stop_server(self) -> None:
        await asyncio.wait({in_a_thread(self._server.stop)}, timeout=VIEWER_STOP_S)

    # -- publishing ------------------------------------------------------------------------------------

    def _publish(self, message: Message) -> None:
        self._channels[message.topic].log(message.data, log_time=message.nanoseconds)
        # Every command goes to RUNNING_CC and back; publishing these would double the work.
        if message.topic is EVENT and self._hand.state not in (self._published_state, State.RUNNING_CC):
            self._publish_state()
        if message.topic is TRANSFORMS:
            self._publish_parts(message.nanoseconds)

    def _publish_parts(self, nanoseconds: int) -> None:
        if (told := bodies_of(self._hand)) is not None:
            parts = parts_message(hand_model(self._hand.model).root, joints_and_parts(told)[1], nanoseconds)
            self._channels[PARTS].log(compact(parts), log_time=nanoseconds)

    def _describe(self) -> None:
        self._channels[DESCRIPTION].log(encode_description(self._hand.model))

    def _publish_state(self) -> None:
        self._published_state = self._hand.state
        at = now()
        data = compact(state_fields(self._hand, at))
        self._channels[STATE_TOPIC].log(data, log_time=self._feed.nanoseconds(at))

    async def _publish_periodically(self) -> None:
        while True:
            self._publish_state()
            await asyncio.sleep(STATE_S)


class _SubscriptionListener(ServerListener):
    """Reports subscriptions to the description; the server calls it in a thread."""

    def __init__(self, describe: Callable[[], None]) -> None:
        self._describe = describe

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        if channel.topic == DESCRIPTION.name:
            self._describe()


def parts_message(root: str, parts: Sequence[Shape], nanoseconds: int) -> dict[str, Any]:
    """Parts as a scene of Foxglove: an entity in the frame of the root link, which replaces that before."""
    solids: dict[str, list[dict[str, Any]]] = {name: [] for name in _SOLIDS.values()}
    for part in parts:
        size = dict(zip("xyz", _extent(part), strict=True))
        solid = {"pose": _placed(part.origin), "size": size, "color": _YELLOW}
        solids[_SOLIDS[part.kind]].append({**solid, "bottom_scale": 1.0, "top_scale": 1.0})
    named = {"timestamp": _time(nanoseconds), "frame_id": root, "id": "parts", "frame_locked": True}
    return {"entities": [named | solids]}


def _extent(part: Shape) -> tuple[float, ...]:
    if part.kind == "box":
        return part.size
    across = 2 * part.size[0]
    return across, across, part.size[1] if part.kind == "cylinder" else across


def _placed(pose: Pose) -> dict[str, dict[str, float]]:
    return {
        "position": dict(zip("xyz", pose.position, strict=True)),
        "orientation": dict(zip("xyzw", pose.quaternion, strict=True)),
    }


def _time(nanoseconds: int) -> dict[str, int]:
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return {"sec": seconds, "nsec": rest}


def _channel(topic: Topic, context: Context) -> Channel:
    schema = Schema(name=topic.schema_name, encoding=topic.schema_encoding, data=topic.schema)
    return Channel(topic.name, schema=schema, message_encoding=topic.encoding, context=context)
