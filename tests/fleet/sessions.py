"""Sessions of zenoh over loopback: an agent's side that answers everything, agents, and clients."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import AsyncIterator, Callable
from contextlib import AsyncExitStack, asynccontextmanager
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, Final

from zenoh import SampleKind
from zenoh.handlers import Callback

from robotiq_async import RobotiqHand
from robotiq_async.fleet.agent.agent import Agent
from robotiq_async.fleet.network.bus import MessageKind, Query, Urgency
from robotiq_async.fleet.network.configuration import (
    agent_configuration,
    client_configuration,
    session_configuration,
)
from robotiq_async.fleet.network.zenoh_bus import ZenohBus, open_bus
from tests.fleet.lab import LEFT, serving
from tests.patience import patience

TELEMETRY: Final = b"news"
PATIENCE: Final = 10.0


def free_port() -> int:
    with socket.socket() as reserved:
        reserved.bind(("127.0.0.1", 0))
        return int(reserved.getsockname()[1])


@dataclass
class Client:
    """A client's session."""

    bus: ZenohBus
    connected: asyncio.Event = field(default_factory=asyncio.Event)
    disconnected: asyncio.Event = field(default_factory=asyncio.Event)
    kept: list[object] = field(default_factory=list)

    async def may(self, *parts: str) -> bool:
        """Whether a request is answered."""
        query = LEFT.question(self.bus.who or "nobody") if parts == ("info",) else LEFT.key(*parts)
        return (
            await self.bus.ask(query, b"?", timeout=patience(PATIENCE), urgency=Urgency.COMMAND) is not None
        )

    def subscribe(self, expression: str) -> asyncio.Event:
        """Set when something comes."""
        heard = asyncio.Event()
        self.kept.append(self.bus.subscribe(expression, lambda *_: heard.set()))
        return heard

    def watch(self, expression: str) -> asyncio.Event:
        """Set when an agent is seen."""
        seen = asyncio.Event()
        self.kept.append(self.bus.watch(expression, lambda *_: seen.set()))
        return seen


@dataclass
class Answering:
    """Something that answers to every key of an agent."""

    bus: ZenohBus
    publish: Callable[[str], None]
    """Takes the last part of the key."""
    heard: asyncio.Event = field(default_factory=asyncio.Event)
    """Whether something was published."""


@dataclass
class Line:
    """A port, and what is opened at it; closed at the end."""

    endpoint: str
    stack: AsyncExitStack

    async def open(self, configuration: dict[str, object]) -> ZenohBus:
        bus = await open_bus(configuration, self.endpoint)
        self.stack.push_async_callback(bus.close)
        return bus

    async def agent_bus(self, keys: Path | None = None, *grippers: str) -> ZenohBus:
        return await self.open(agent_configuration("lab", "cell", grippers, [self.endpoint], keys=keys))

    async def answering(self, keys: Path) -> Answering:
        """The agent's side."""
        bus = await self.agent_bus(keys)

        def answer(query: Query) -> None:
            query.reply(b"!")

        for verb in ("info/*", "lease", "halt", "cmd/*"):
            self.stack.callback(bus.serve(f"robotiq/v1/lab/cell/*/{verb}", answer))
        self.stack.callback(bus.announce(LEFT.key("alive", "77")))
        publish = {
            name: bus.publisher(LEFT.key(name), Urgency.TELEMETRY) for name in ("feed", "summary", "other")
        }
        side = Answering(bus, lambda name: publish[name](TELEMETRY))
        # What it publishes itself is heard too.
        self.stack.callback(
            bus.subscribe("**", lambda _, payload: None if payload == TELEMETRY else side.heard.set())
        )
        return side

    async def serve(self, hand: RobotiqHand, keys: Path | None = None) -> None:
        """An agent that serves a hand as zenoh://lab/cell/left."""
        await self.serve_over(await self.agent_bus(keys, "left"), hand)

    async def serve_over(self, bus: ZenohBus, hand: RobotiqHand) -> None:
        served = Agent("lab", "cell", {"left": hand}, bus)
        await self.stack.enter_async_context(serving(served))

    async def server(self, keys: Path) -> None:
        """Something that listens with any keys."""
        await self.open(session_configuration([self.endpoint], [], keys))

    async def client(self, keys: Path | None, mode: str = "peer") -> Client:
        """A client that has tried to connect; without keys it is one that zenoh's own tools would be."""
        if keys is None:
            configuration = session_configuration([], [self.endpoint])
        else:
            configuration = client_configuration([self.endpoint], keys=keys)
        client = Client(bus := await self.open(configuration | {"mode": mode}))

        def tell(event: Any) -> None:
            is_there = event.kind == SampleKind.PUT
            bus._mailbox.put((client.connected if is_there else client.disconnected).set, MessageKind.ANSWER)

        listener = bus._session.info.declare_transport_events_listener(
            Callback(tell, indirect=False), history=True
        )
        client.kept.append(listener)
        return client


@asynccontextmanager
async def line(
    host: str = "127.0.0.1", protocol: str = "tls", seconds: float = PATIENCE
) -> AsyncIterator[Line]:
    async with AsyncExitStack() as stack, asyncio.timeout(patience(seconds)):
        yield Line(f"{protocol}/{host}:{free_port()}", stack)
