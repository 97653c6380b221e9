"""Shows a hand to Foxglove and Lichtblick while it works. Needs the extra ``view`` (foxglove-sdk).

    hand = RobotiqHand(address)
    async with Viewer(hand), hand:
        ...

In this order nothing that concerns viewers delays the stop of the hand.

The topics are those of a recording (:mod:`.feed`) and ``/gripper/state``: state, fault and figures of the
polling, once a second and at every event. There is no password, and the server does not ask where a request
comes from: whoever reaches the port sees the hand and, with an operator, commands it. A web page that is open
on the same machine reaches it too.
"""

from __future__ import annotations

import asyncio
import concurrent.futures
import json
import threading
from collections.abc import Callable
from types import TracebackType
from typing import Any, Final, Self

try:
    import foxglove
    from foxglove import Channel, Context, MessageSchema, Schema, ServiceRequest, ServiceSchema
    from foxglove.websocket import Capability, WebSocketServer
except ModuleNotFoundError as error:
    raise ImportError("viewers need foxglove-sdk: pip install 'robotiq-async[view]'") from error

from ..actions import Operator
from ..concurrency import in_a_thread, wait_shielded
from ..enums import State
from ..errors import ViewerError
from ..protocol import Hand
from ..session.clock import now
from ..wire.checks import check_int
from .feed import EVENT, TOPICS, Feed, Message, Topic, compact, json_topic
from .payloads import SCHEMAS, state_fields
from .services import RESPONSE, SERVICES, Service

LOOPBACK: Final = "127.0.0.1"
PORT: Final = 8765
"""What Foxglove offers when it is asked to open a connection."""
STATE: Final = json_topic("state", SCHEMAS["state"])
STATE_S: Final = 1.0
"""Between two messages about the state when nothing happens."""
STOP_S: Final = 1.0
"""What the server may take to say goodbye to its clients."""
LARGEST: Final = 4096
"""Bytes of a request; it is read in the loop that polls."""
WAITING: Final = 16
"""Calls that may wait for their end at a time; the server's threads are not without number."""
LOOK_S: Final = 0.5
"""Between two looks of a caller's thread whether the loop still runs."""
HALT: Final = "/gripper/halt"
"""The call that always finds a place."""


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
    ) -> None:
        """Prepare; opens nothing.

        Args:
            hand: started before or while it is viewed.
            host: the interface to listen on.
            port: 0 takes a free one.
            operator: who asks when a viewer calls a service; None serves no commands.

        Raises:
            TypeError: port is not an int.
            ValueError: port is outside 0..65535, or the operator is at another hand.
        """
        if operator is not None and operator.hand is not hand:
            raise ValueError(f"operator must be at {hand!r}, which is shown, and not at {operator.hand!r}")
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
        self._serving: set[asyncio.Task[Any]] = set()
        self._places = threading.BoundedSemaphore(WAITING)
        self._closing = False
        self._told: State | None = None

    @property
    def url(self) -> str:
        """What a viewer is given."""
        host = f"[{self.host}]" if ":" in self.host else self.host
        return f"ws://{host}:{self.port}"

    async def __aenter__(self) -> Self:
        """Listen, and begin to tell.

        Raises:
            ViewerError: the port is taken, or there is no such interface.
        """
        self._loop = asyncio.get_running_loop()
        self._closing = False
        self._context = Context()
        self._channels = {topic: _channel(topic, self._context) for topic in (*TOPICS, STATE)}
        listening = in_a_thread(self._listen)
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
        self.port = self._server.port
        self._feed.begin()
        self._telling = self._loop.create_task(self._tell_again_and_again(), name="robotiq_async viewer")
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        """Take no more calls, give up those that wait (a move is held), and close the port.

        Takes a second at most, and is finished also when cancelled meanwhile.
        """
        await wait_shielded(asyncio.ensure_future(self._close()))

    async def _close(self) -> None:
        self._closing = True
        self._telling.cancel()
        await asyncio.gather(self._telling, return_exceptions=True)
        await self._give_up_calls()
        await self._feed.end()
        await self._stop_server()
        await self._give_up_calls()

    async def _give_up_calls(self) -> None:
        while self._serving:
            calls = list(self._serving)
            for call in calls:
                call.cancel()
            await asyncio.gather(*calls, return_exceptions=True)

    async def _stop_server(self) -> None:
        """The port is closed at once; a client that does not listen may keep the rest waiting for ever."""
        await asyncio.wait({in_a_thread(self._server.stop)}, timeout=STOP_S)

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
        # With every command the state goes to RUNNING_CC and back: telling that would double the work.
        if message.topic is EVENT and self._hand.state not in (self._told, State.RUNNING_CC):
            self._tell_state()

    def _tell_state(self) -> None:
        self._told = self._hand.state
        at = now()
        data = compact(state_fields(self._hand, at))
        self._channels[STATE].log(data, log_time=self._feed.nanoseconds(at))

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
            if len(request.payload) > LARGEST:
                raise ViewerError(f"{service.name} takes {LARGEST} bytes at most, got {len(request.payload)}")
            if service.name == HALT:
                return self._answer(service, request.payload)
            if not self._places.acquire(blocking=False):
                raise ViewerError(f"{WAITING} calls wait for their end already")
            try:
                return self._answer(service, request.payload)
            finally:
                self._places.release()

        return handle

    def _answer(self, service: Service, payload: bytes) -> bytes:
        asking = asyncio.run_coroutine_threadsafe(self._serve(service, payload), self._loop)
        # Every command has a time-out of its own; a loop that has ended without a goodbye has none.
        while not concurrent.futures.wait([asking], LOOK_S).done:
            if not self._loop.is_running():
                asking.cancel()
                raise ViewerError("the program that serves this gripper has ended")
        return asking.result()

    async def _serve(self, service: Service, payload: bytes) -> bytes:
        if self._closing or self._operator is None:
            raise ViewerError("no more calls are taken")
        task = asyncio.current_task()
        assert task is not None
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
