"""Shows a hand to Foxglove and Lichtblick while it works. Needs the extra ``view`` (foxglove-sdk).

    hand = RobotiqHand(address)
    async with Viewer(hand), hand:
        ...

In this order nothing that concerns viewers delays the stop of the hand.

The topics are those of a recording (:mod:`.feed`); ``/gripper/state``: state, fault and statistics, once a
second and at every event; ``/robot_description`` and ``/tf`` for 3-D panels. There is no password: whichever
program reaches the port sees the hand and, with an operator, commands it. Pages of other sites do not: the
origin of every connection is looked at (:mod:`.gate`).
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import json
import threading
from collections.abc import Callable, Collection
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self

try:
    import foxglove
    from foxglove import Channel, Context, MessageSchema, Schema, ServiceRequest, ServiceSchema
    from foxglove.websocket import Capability, ChannelView, Client, ServerListener, WebSocketServer
except ModuleNotFoundError as error:
    from ...runtime.extras import install

    raise ImportError(f"viewers need foxglove-sdk: {install('view')}") from error

from ...protocol import Hand
from ...runtime.clock import now
from ...runtime.concurrency import in_a_thread, wait_shielded
from ...runtime.log import log
from ...values.checks import check_int
from ...values.enums import State
from ...values.errors import ViewerError
from ..actions import Operator
from ..description.robot_description import (
    SCHEMA,
    SCHEMA_NAME,
    TRANSFORMS_NAME,
    TRANSFORMS_SCHEMA,
    description_message,
    transforms,
)
from ..recording.feed import EVENT, JOINTS, TOPICS, Feed, Message, Topic, compact, json_topic
from ..recording.payloads import SCHEMAS, state_fields, title
from .gate import Gate, hidden_address
from .services import RESPONSE, SERVICES, Service

LOOPBACK: Final = "127.0.0.1"
PORT: Final = 8765
"""The default of Foxglove's own dialog."""
STATE: Final = json_topic("state", SCHEMAS["state"])
DESCRIPTION: Final = Topic("/robot_description", "cdr", SCHEMA_NAME, "ros2msg", SCHEMA.encode())
_TRANSFORMS_SCHEMA: Final = json.dumps(TRANSFORMS_SCHEMA).encode()
TRANSFORMS: Final = Topic("/tf", "json", TRANSFORMS_NAME, "jsonschema", _TRANSFORMS_SCHEMA)
SHOWN: Final = (*TOPICS, STATE, DESCRIPTION, TRANSFORMS)
ORIGINS: Final = ("https://app.foxglove.dev",)
"""Where viewers are served from that run in a browser; programs have no origin."""
TRANSFORMS_S: Final = 0.05
STATE_S: Final = 1.0
"""Between two messages on ``/gripper/state`` when nothing happens."""
STOP_S: Final = 1.0
"""How long the server may take to close its connections."""
MAX_BYTES: Final = 4096
"""Bytes of a request; it is parsed in the event loop that polls."""
MAX_CALLS: Final = 16
"""Calls in progress at a time, a thread each."""
LOOP_CHECK_S: Final = 0.5
"""How often the thread of a call checks whether the event loop still runs."""
HALT: Final = "/gripper/halt"
"""The service that is never refused for too many calls."""


class Viewer:
    """Serves a hand to viewers while a block runs.

    Attributes:
        host: the interface.
        port: the TCP port; the one that was found free once it serves.
    """

    def __init__(
        self,
        hand: Hand,
        *,
        host: str = LOOPBACK,
        port: int = PORT,
        operator: Operator | None = None,
        origins: Collection[str] = ORIGINS,
    ) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is viewed.
            host: the interface to listen on.
            port: 0 takes a free one.
            operator: carries out what a viewer calls; None offers no services.
            origins: pages of these sites may connect, and no others.

        Raises:
            TypeError: port is not an int.
            ValueError: port is outside 0..65535, or the operator has another hand.
        """
        if operator is not None and operator.hand is not hand:
            raise ValueError(f"operator must have {hand!r}, the hand that is shown, got {operator.hand!r}")
        self.host = host
        self.port = check_int("port", port, 0, 65535)
        self._hand = hand
        self._operator = operator
        self._feed = Feed(hand, self._publish)
        self._origins = origins
        self._server: WebSocketServer
        self._gate: Gate
        self._context: Context
        """Its channels close when the last reference to it is gone."""
        self._channels: dict[Topic, Channel] = {}
        self._loop: asyncio.AbstractEventLoop
        self._publisher: asyncio.Task[None]
        self._calls: dict[asyncio.Task[Any], Service] = {}
        self._transformed_at = 0
        self._slots = threading.BoundedSemaphore(MAX_CALLS)
        self._closing = False
        self._published_state: State | None = None

    @property
    def url(self) -> str:
        """The address to open in a viewer."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws://{host}:{self.port}"

    async def __aenter__(self) -> Self:
        """Listen, and start publishing.

        Raises:
            ViewerError: the port is taken, or there is no such interface.
        """
        self._loop = asyncio.get_running_loop()
        self._closing = False
        self._context = Context()
        self._channels = {topic: _channel(topic, self._context) for topic in SHOWN}
        listening = in_a_thread(self._start_server)
        try:
            await wait_shielded(listening)
        except asyncio.CancelledError:
            if listening.exception() is None:
                self._server = listening.result()
                await wait_shielded(asyncio.ensure_future(self._stop_server()))
            raise
        try:
            self._server = listening.result()
        except (RuntimeError, OSError, ValueError) as error:
            raise ViewerError(f"{self.url}: {error}") from error
        self.port = self._gate.port
        self._feed.start()
        self._publisher = self._loop.create_task(self._publish_periodically(), name="robotiq_async viewer")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Accept no more calls, cancel those in progress (a move is held), and close the port.

        Takes a second at most, and is completed even when cancelled meanwhile.
        """
        await wait_shielded(asyncio.ensure_future(self._close()))

    async def _close(self) -> None:
        self._closing = True
        self._publisher.cancel()
        await asyncio.gather(self._publisher, return_exceptions=True)
        await self._cancel_calls()
        await self._feed.stop()
        await self._stop_server()
        await self._cancel_calls()

    async def _cancel_calls(self) -> None:
        while self._calls:
            calls = list(self._calls)
            for call in calls:
                call.cancel()
            await asyncio.gather(*calls, return_exceptions=True)

    async def _stop_server(self) -> None:
        """The port is closed at once; a client that does not read could delay the rest for ever."""
        self._gate.stop()
        await asyncio.wait({in_a_thread(self._server.stop)}, timeout=STOP_S)

    def _start_server(self) -> WebSocketServer:
        services = [] if self._operator is None else list(SERVICES.values())
        host = hidden_address()
        server = foxglove.start_server(
            name=f"robotiq_async: {title(self._hand)}",
            host=host,
            port=0,
            capabilities=[Capability.Services] if services else [],
            supported_encodings=["json"] if services else None,
            services=[self._service(service) for service in services],
            server_listener=_Listener(self._describe),
            context=self._context,
        )
        try:
            self._gate = Gate(
                self.host,
                self.port,
                (host, server.port),
                origins=self._origins,
                refused=_report,
                left=self._viewer_left,
            )
        except OSError as error:
            server.stop()
            raise ViewerError(f"{self.url}: {error.strerror or error}") from error
        return server

    # -- publishing ------------------------------------------------------------------------------------

    def _publish(self, message: Message) -> None:
        self._channels[message.topic].log(message.data, log_time=message.nanoseconds)
        # With every command the state goes to RUNNING_CC and back: publishing that would double the work.
        if message.topic is EVENT and self._hand.state not in (self._published_state, State.RUNNING_CC):
            self._publish_state()

        if message.topic is JOINTS and message.nanoseconds - self._transformed_at >= TRANSFORMS_S * 1e9:
            self._transformed_at = message.nanoseconds
            data = compact(transforms(self._hand.status, message.nanoseconds))
            self._channels[TRANSFORMS].log(data, log_time=message.nanoseconds)

    def _describe(self) -> None:
        """Somebody has just begun to listen to the description: it never changes, so it is told then."""
        self._channels[DESCRIPTION].log(description_message())

    def _publish_state(self) -> None:
        self._published_state = self._hand.state
        at = now()
        data = compact(state_fields(self._hand, at))
        self._channels[STATE].log(data, log_time=self._feed.nanoseconds(at))

    async def _publish_periodically(self) -> None:
        while True:
            self._publish_state()
            await asyncio.sleep(STATE_S)

    # -- services --------------------------------------------------------------------------------------

    def _service(self, service: Service) -> foxglove.Service:
        request = _schema(f"{service.name[1:]}_request".replace("/", "."), service.schema)
        response = _schema("gripper.response", RESPONSE)
        schema = ServiceSchema(service.name[1:].replace("/", "."), request=request, response=response)
        return foxglove.Service(service.name, schema=schema, handler=self._handler(service))

    def _handler(self, service: Service) -> Callable[[ServiceRequest], bytes]:
        # Called in threads of the server, one for each call: a halt does not wait for a move.
        def handle(request: ServiceRequest) -> bytes:
            if len(request.payload) > MAX_BYTES:
                raise ViewerError(
                    f"{service.name} takes {MAX_BYTES} bytes at most, got {len(request.payload)}"
                )
            if service.name == HALT:
                return self._answer(service, request.payload)
            if not self._slots.acquire(blocking=False):
                raise ViewerError(f"{MAX_CALLS} calls are in progress already")
            try:
                return self._answer(service, request.payload)
            finally:
                self._slots.release()

        return handle

    def _answer(self, service: Service, payload: bytes) -> bytes:
        asking = asyncio.run_coroutine_threadsafe(self._serve(service, payload), self._loop)
        # Every command has a timeout of its own; an event loop that was closed without notice has none.
        while not concurrent.futures.wait([asking], LOOP_CHECK_S).done:
            if not self._loop.is_running():
                asking.cancel()
                raise ViewerError("the program that serves this gripper has ended")
        return asking.result()

    async def _serve(self, service: Service, payload: bytes) -> bytes:
        if self._closing or self._operator is None:
            raise ViewerError("no more calls are accepted")
        task = asyncio.current_task()
        assert task is not None
        self._calls[task] = service
        try:
            return compact({"outcome": await service.call(self._operator, payload)})
        finally:
            del self._calls[task]

    def _viewer_left(self) -> None:
        with suppress(RuntimeError):  # the loop has been closed meanwhile
            self._loop.call_soon_threadsafe(self._hold_calls)

    def _hold_calls(self) -> None:
        """A viewer has left, and the server does not tell whose call is whose: what moves is held."""
        for call, service in self._calls.items():
            if service.name != HALT:
                call.cancel()


class _Listener(ServerListener):
    """Hears who subscribes to the description, in a thread of the server."""

    def __init__(self, describe: Callable[[], None]) -> None:
        self._describe = describe

    def on_subscribe(self, client: Client, channel: ChannelView) -> None:  # noqa: ARG002
        if channel.topic == DESCRIPTION.name:
            self._describe()


def _report(origin: str) -> None:
    log.warning(
        "a page of %s was refused; if it is your viewer, name it: origins, or --origin %s", origin, origin
    )


def _channel(topic: Topic, context: Context) -> Channel:
    schema = Schema(name=topic.schema_name, encoding=topic.schema_encoding, data=topic.schema)
    return Channel(topic.name, schema=schema, message_encoding=topic.encoding, context=context)


def _schema(name: str, schema: object) -> MessageSchema:
    described = Schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return MessageSchema(encoding="json", schema=described)
