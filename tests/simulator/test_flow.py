"""Clients that send requests and do not read: their buffer is bounded, and others are served."""

from __future__ import annotations

import asyncio
import os
import socket
import struct
from collections.abc import AsyncIterator, Iterator
from contextlib import asynccontextmanager, suppress
from typing import Any

import pytest

pytest.importorskip("pty")

from robotiq_async.simulator import SerialSimulatorServer, SimulatedGripper, SimulatorServer, Trouble
from robotiq_async.simulator.server.connection import MOST_UNREAD, MOST_WAITING
from robotiq_async.simulator.server.serial_server import MOST_UNSENT
from tests.patience import patience
from tests.serial_line import with_crc
from tests.simulator.conftest import simulator
from tests.simulator.test_serial_server import Line
from tests.simulator.test_server import RawClient, raw_client
from tests.virtual import virtual
from tests.virtual_line import VirtualLine

REQUESTS = 8_000
READ = with_crc(bytes.fromhex("09 03 03e8 0008"))
ANSWER = with_crc(bytes.fromhex("09 03 10") + bytes(16))
OURS = 4096
"""Bytes that the server keeps for a client before it takes no more requests of it."""
LARGEST_READ = 256 * 1024
"""Bytes that asyncio takes from a socket at a time."""


def writes(client: RawClient, count: int) -> bytes:
    """Requests that write one register each, answered by 12 bytes each."""
    return b"".join(client.frame(struct.pack(">BHH", 6, 1, value & 0xFFFF)) for value in range(count))


@asynccontextmanager
async def narrow(server: SimulatorServer) -> AsyncIterator[RawClient]:
    """A client for which the system keeps little on its way, in either direction."""
    for at in (socket.SO_SNDBUF, socket.SO_RCVBUF):
        server._listener.sockets[0].setsockopt(socket.SOL_SOCKET, at, 4096)
    line = socket.create_connection(("127.0.0.1", server.port))
    line.setblocking(False)
    line.setsockopt(socket.SOL_SOCKET, socket.SO_RCVBUF, 4096)
    reader, writer = await asyncio.open_connection(sock=line, limit=2**12)
    try:
        while not server.connections:  # noqa: ASYNC110
            await asyncio.sleep(0)
        server.connections[-1].transport.set_write_buffer_limits(OURS)  # 64 kB, by asyncio: 5000 answers more
        yield RawClient(reader, writer)
    finally:
        writer.transport.abort()
        await asyncio.sleep(0)


async def until_held(server: SimulatorServer) -> None:
    """Wait until a client is no longer read from."""
    async with asyncio.timeout(patience(20)):
        while all(each.transport.is_reading() for each in server.connections):  # noqa: ASYNC110
            await asyncio.sleep(0.001)


async def test_a_client_that_never_reads_has_to_wait() -> None:
    async with SimulatorServer() as server, narrow(server) as client:
        requests = writes(client, REQUESTS)
        client.writer.write(requests)
        await until_held(server)
        (connection,) = server.connections
        assert len(connection._inbox) <= MOST_UNREAD + LARGEST_READ
        assert connection.transport.get_write_buffer_size() < 2 * OURS
        async with raw_client(server) as other:
            assert (await other.read_status()).is_reset, "others are served meanwhile"
        async with asyncio.timeout(patience(20)):
            answers = await client.reader.readexactly(len(requests))
        assert answers == requests, "nothing is lost, and all in order: each is answered by its echo"
        assert connection.transport.is_reading()


async def test_a_client_that_goes_away_while_it_has_to_wait() -> None:
    async with SimulatorServer() as server:
        async with narrow(server) as client:
            client.writer.write(writes(client, REQUESTS))
            await until_held(server)
        async with asyncio.timeout(patience(5)), raw_client(server) as other:
            assert (await other.read_status()).is_reset
            while len(server.connections) > 1:  # noqa: ASYNC110
                await asyncio.sleep(0)


@virtual
async def test_replies_that_are_sent_later_are_not_kept_without_limit() -> None:
    async with simulator() as server, raw_client(server) as client:
        await server.fault_injector.begin(Trouble("delay", 10))
        requests = writes(client, 3_000)
        client.writer.write(requests)
        await asyncio.sleep(9)
        assert len(server.gripper.writes) == MOST_WAITING
        await asyncio.sleep(61)
        assert await client.reader.readexactly(len(requests)) == requests


# On a serial line no client can be made to wait.


@pytest.fixture
def line() -> Iterator[Line]:
    line = Line()
    yield line
    line.close()


async def test_replies_that_are_not_read_from_a_serial_line_are_lost(line: Line) -> None:
    answered = asyncio.Event()

    def policy(reply: bytes) -> list[tuple[float, bytes]]:
        answered.set()
        return [(0.0, reply)]

    async with SerialSimulatorServer(line.port, paced=False) as server:
        server.policy = policy
        (connection,) = server.connections
        transport: Any = connection.transport
        for _ in range(5000):
            answered.clear()
            line.send(READ)
            await answered.wait()
            assert sum(map(len, transport.intern_write_buffer)) <= MOST_UNSENT
        received = b""
        while transport.get_write_buffer_size() or not received.endswith(ANSWER):
            await asyncio.sleep(0)
            with suppress(BlockingIOError):
                received += os.read(line.master, 4096)
        assert received == ANSWER * (len(received) // len(ANSWER)), "whole ones"
        assert len(received) < 4000 * len(ANSWER), "not all of them"
        line.send(READ)
        assert await line.receive(len(ANSWER)) == ANSWER


@virtual
async def test_requests_that_come_faster_than_they_are_answered_are_lost(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    cable = VirtualLine(monkeypatch)
    gripper = SimulatedGripper(asyncio.get_running_loop().time)
    async with SerialSimulatorServer(cable.FAR, gripper, paced=False) as server:
        (connection,) = server.connections
        for _ in range(1000):
            connection.data_received(100 * READ)
            assert len(connection._inbox) <= MOST_UNREAD + 100 * len(READ)
        await asyncio.sleep(60)
        assert not connection._inbox
