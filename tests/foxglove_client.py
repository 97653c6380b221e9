"""A viewer that speaks the protocol foxglove.sdk.v1 by hand: no code of the server's is used."""

from __future__ import annotations

import asyncio
import contextlib
import json
import struct
from collections.abc import AsyncIterator, Callable
from typing import Any

from websockets.asyncio.client import ClientConnection, connect
from websockets.typing import Subprotocol

from robotiq_async.tools.viewer import Viewer
from tests.patience import patience

MESSAGE_DATA = 1
"""The binary operation of the protocol foxglove.sdk.v1."""


class Client:
    """One connection, and what came over it."""

    def __init__(self, socket: ClientConnection) -> None:
        self.socket = socket
        self.messages: list[dict[str, Any]] = []
        self.channels: dict[str, dict[str, Any]] = {}
        self.services: dict[str, dict[str, Any]] = {}
        self._topics: dict[int, str] = {}
        self.received: list[tuple[str, int, bytes]] = []
        self._objects: dict[str, list[dict[str, Any]]] = {}

    async def read(self) -> None:
        """One frame."""
        async with asyncio.timeout(patience(20)):
            frame = await self.socket.recv()
        if isinstance(frame, str):
            said = json.loads(frame)
            self.messages.append(said)
            if said["op"] == "advertise":
                self.channels |= {channel["topic"]: channel for channel in said["channels"]}
            elif said["op"] == "advertiseServices":
                self.services |= {service["name"]: service for service in said["services"]}
        elif frame[0] == MESSAGE_DATA:
            number, nanoseconds = struct.unpack_from("<IQ", frame, 1)
            topic = self._topics[number]
            self.received.append((topic, nanoseconds, frame[13:]))
            if topic not in ("/joint_states", "/robot_description", "/tf"):
                self._objects.setdefault(topic, []).append(json.loads(frame[13:]))

    async def until(self, condition: Callable[[], bool]) -> None:
        while not condition():
            await self.read()

    async def subscribe(self, *topics: str) -> None:
        subscriptions = []
        for topic in topics:
            number = len(self._topics) + 1
            self._topics[number] = topic
            subscriptions.append({"id": number, "channelId": self.channels[topic]["id"]})
        await self.socket.send(json.dumps({"op": "subscribe", "subscriptions": subscriptions}))
        # A subscription is not acknowledged. What is read after it is: what comes from here on is not missed.
        await (await self.socket.ping())

    def objects(self, topic: str) -> list[dict[str, Any]]:
        return self._objects.get(topic, [])


@contextlib.asynccontextmanager
async def client(viewer: Viewer) -> AsyncIterator[Client]:
    subprotocols = [Subprotocol("foxglove.sdk.v1")]
    # A queue that is full would keep the client from hearing that the connection closes.
    async with connect(viewer.url, subprotocols=subprotocols, max_queue=None) as socket:
        client = Client(socket)
        await client.until(lambda: len(client.channels) >= 7)
        yield client
