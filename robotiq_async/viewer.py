"""Shows a hand to Foxglove and Lichtblick while it works. Needs the extra ``view`` (foxglove-sdk).

    async with RobotiqHand(address) as hand, Viewer(hand):
        ...

The topics are those of a recording (:mod:`.feed`) and ``/gripper/state``: state, fault and figures of the
polling, once a second and at every event. There is no password, and the server does not ask where a request
comes from: whoever reaches the port sees the hand and, with an operator, commands it. A web page that is open
on the same machine reaches it too.
"""

from __future__ import annotations

import asyncio
import json
from collections.abc import Callable
from types import TracebackType
from typing import Final, Self

import foxglove
from foxglove import Channel, Context, MessageSchema, Schema, ServiceRequest, ServiceSchema
from foxglove.websocket import Capability, WebSocketServer

from .actions import Operator
from .checks import check_int
from .errors import RobotiqError
from .feed import EVENT, TOPICS, Feed, Message, Topic, compact, json_topic
from .hand import RobotiqHand
from .payloads import SCHEMAS, state_fields
from .services import RESPONSE, SERVICES, Service

LOOPBACK: Final = "127.0.0.1"
PORT: Final = 8765
"""What Foxglove offers when it is asked to open a connection."""
STATE: Final = json_topic("state", SCHEMAS["state"])
STATE_S: Final = 1.0
"""Between two messages about the state when nothing happens."""
PATIENCE_S: Final = 120.0
"""How long a caller is kept waiting at most; every command has a shorter time-out of its own."""


class ViewerError(RobotiqError):
    """A viewer could not be served."""


class Viewer:
    """Serves a hand to viewers while a block runs.

    Attributes:
        host: the interface.
        port: the TCP port; the one that was found free once it serves.
    """

    def __init__(
        self,
        hand: RobotiqHand,
        *,
        host: str = LOOPBACK,
        port: int = PORT,
        operator: Operator | None = None,
    ) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is viewed.
            host: the interface to listen on.
            port: 0 takes a free one.
            operator: who asks when a viewer calls a service; None serves no commands.

        Raises:
            TypeError: port is not an int.
            ValueError: port is outside 0..65535.
        """
        self.host = host
        self.port = check_int("port", port, 0, 65535)
        self._hand = hand
        self._operator = operator
        self._feed = Feed(hand, self._take)
        self._server: WebSocketServer
        self._context: Context
        """Channels close when nobody holds it any more."""
        self._channels: dict[Topic, Channel] = {}
        self._loop: asyncio.AbstractEventLoop
        self._telling: asyncio.Task[None]
        self._serving: set[asyncio.Task[bytes]] = set()

    @property
    def url(self) -> str:
        """What a viewer is given."""
        return f"ws://{self.host}:{self.port}"

    async def __aenter__(self) -> Self:
        """Listen, and begin to tell.

        Raises:
            ViewerError: the port is taken, or there is no such interface.
        """
        self._loop = asyncio.get_running_loop()
        self._context = Context()
        self._channels = {topic: _channel(topic, self._context) for topic in (*TOPICS, STATE)}
        try:
            self._server = await asyncio.to_thread(self._listen)
        except (RuntimeError, OSError) as error:
            raise ViewerError(f"{self.url}: {error}") from error
        self.port = self._server.port
        self._feed.begin()
        self._telling = self._loop.create_task(self._tell_again_and_again(), name="robotiq_async viewer")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Give up what callers wait for (a move is held), and close the port."""
        unfinished = [self._telling, *self._serving]
        for task in unfinished:
            task.cancel()
        await asyncio.gather(*unfinished, return_exceptions=True)
        await self._feed.end()
        # In a thread: it waits for its own threads, and one of those may wait for this loop.
        await asyncio.to_thread(self._server.stop)

    def _listen(self) -> WebSocketServer:
        services = [] if self._operator is None else list(SERVICES.values())
        return foxglove.start_server(
            name="robotiq_async",
            host=self.host,
            port=self.port,
            capabilities=[Capability.Services] if services else [],
            supported_encodings=["json"] if services else None,
            services=[self._offered(service) for service in services],
            context=self._context,
        )

    # -- what is told ----------------------------------------------------------------------------------

    def _take(self, message: Message) -> None:
        self._channels[message.topic].log(message.data, log_time=message.nanoseconds)
        if message.topic is EVENT:
            self._tell_state()

    def _tell_state(self) -> None:
        self._channels[STATE].log(compact(state_fields(self._hand)))

    async def _tell_again_and_again(self) -> None:
        while True:
            self._tell_state()
            await asyncio.sleep(STATE_S)

    # -- what is asked ---------------------------------------------------------------------------------

    def _offered(self, service: Service) -> foxglove.Service:
        request = _schema(f"{service.name[1:]}_request".replace("/", "."), service.schema)
        response = _schema("gripper.response", RESPONSE)
        schema = ServiceSchema(service.name[1:].replace("/", "."), request=request, response=response)
        return foxglove.Service(service.name, schema=schema, handler=self._handler(service))

    def _handler(self, service: Service) -> Callable[[ServiceRequest], bytes]:
        # Called in threads of the server's, one for each call: a halt does not wait for a move.
        def handle(request: ServiceRequest) -> bytes:
            asking = asyncio.run_coroutine_threadsafe(self._serve(service, request.payload), self._loop)
            try:
                return asking.result(PATIENCE_S)
            finally:
                asking.cancel()

        return handle

    async def _serve(self, service: Service, payload: bytes) -> bytes:
        task = asyncio.current_task()
        assert task is not None
        assert self._operator is not None
        self._serving.add(task)
        try:
            return compact({"outcome": await service.call(self._operator, payload)})
        finally:
            self._serving.discard(task)


def _channel(topic: Topic, context: Context) -> Channel:
    schema = Schema(name=topic.schema_name, encoding=topic.schema_encoding, data=topic.schema)
    return Channel(topic.name, schema=schema, message_encoding=topic.encoding, context=context)


def _schema(name: str, schema: object) -> MessageSchema:
    described = Schema(name=name, encoding="jsonschema", data=json.dumps(schema).encode())
    return MessageSchema(encoding="json", schema=described)
