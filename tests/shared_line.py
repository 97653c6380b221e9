"""Two grippers on one line, of this machine or behind a serial server, in a virtual loop."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections.abc import AsyncIterator, Callable, Mapping
from contextlib import AbstractAsyncContextManager, AsyncExitStack, asynccontextmanager
from typing import Any

import pytest

from robotiq_async import ReconnectPolicy, RobotiqHand
from robotiq_async.simulator import RtuOverTcpSimulatorServer, SerialSimulatorServer, SimulatedGripper
from robotiq_async.values.model import TWO_FINGER_85
from tests.virtual_line import VirtualLine

Server = SerialSimulatorServer | RtuOverTcpSimulatorServer
RESPONSE_S = 0.25


class Bus(ABC):
    """A line with grippers, by their unit ids.

    Attributes:
        address: of the line.
        servers: of the grippers.
        pulls: how often the line was taken away.
    """

    def __init__(self, address: str, servers: Mapping[int, Server]) -> None:
        self.address = address
        self.servers = servers
        self.pulls = 0

    def gripper(self, unit: int) -> SimulatedGripper:
        return self.servers[unit].gripper

    def hand(self, unit: int | None, address: str = "", **options: Any) -> RobotiqHand:
        """A hand for a unit of the line; a lost one is looked for every half second at least."""
        usual: dict[str, Any] = {"model": TWO_FINGER_85, "response_timeout": RESPONSE_S, "device_id": unit}
        policy = ReconnectPolicy(first_delay=0.1, max_delay=0.5)
        return RobotiqHand(address or self.address, reconnect=policy, **usual | options)

    def pull(self) -> None:
        """Take the line away from all of its hands."""
        self.pulls += 1
        self._pull()

    @abstractmethod
    def _pull(self) -> None:
        """Let the hands lose the line, and not find it again."""

    @abstractmethod
    async def plug(self) -> None:
        """Put it back."""


Kind = Callable[[pytest.MonkeyPatch, Mapping[int, SimulatedGripper]], AbstractAsyncContextManager[Bus]]


class _SerialBus(Bus):
    """An adapter with several devices at the far end of its cable."""

    def __init__(self, line: VirtualLine, servers: Mapping[int, Server]) -> None:
        super().__init__(f"rtu://{line.near}", servers)
        self._line = line

    def _pull(self) -> None:
        self._line.pull()

    async def plug(self) -> None:
        self._line.plug()


@asynccontextmanager
async def serial_bus(
    patch: pytest.MonkeyPatch, grippers: Mapping[int, SimulatedGripper]
) -> AsyncIterator[Bus]:
    """A line at a port of this machine."""
    line = VirtualLine(patch)
    async with AsyncExitStack() as stack:
        servers = {
            unit: SerialSimulatorServer(VirtualLine.FAR, gripper, device_id=unit)
            for unit, gripper in grippers.items()
        }
        for server in servers.values():
            await stack.enter_async_context(server)
        yield _SerialBus(line, servers)


class _Tee(asyncio.Protocol):
    """The client's end of a serial server with several devices behind it."""

    def __init__(self, ports: list[int]) -> None:
        self._ports = ports
        self._behind: list[Any] = []

    def connection_made(self, transport: asyncio.BaseTransport) -> None:
        self.transport: Any = transport
        loop: Any = asyncio.get_running_loop()
        self._behind = [loop.connect(lambda: _Branch(self), port) for port in self._ports]

    def data_received(self, data: bytes) -> None:
        for each in self._behind:
            each.write(data)

    def connection_lost(self, _: Exception | None) -> None:
        for each in self._behind:
            each.close()


class _Branch(asyncio.Protocol):
    """The bytes from one of the devices."""

    def __init__(self, tee: _Tee) -> None:
        self._tee = tee

    def data_received(self, data: bytes) -> None:
        self._tee.transport.write(data)


class _SocketBus(Bus):
    """A serial server with several devices on its line."""

    def __init__(self, servers: Mapping[int, Server]) -> None:
        super().__init__("", servers)
        self._tees: list[_Tee] = []
        self._listener: asyncio.Server | None = None
        self._port = 0

    async def plug(self) -> None:
        loop = asyncio.get_running_loop()
        self.close()
        self._listener = await loop.create_server(self._tee, "127.0.0.1", self._port)
        self._port = self._listener.sockets[0].getsockname()[1]
        self.address = f"rtu+tcp://127.0.0.1:{self._port}"

    def _tee(self) -> _Tee:
        self._tees.append(_Tee([server.port for server in self.servers.values()]))  # type: ignore[misc]
        return self._tees[-1]

    def _pull(self) -> None:
        self.close()
        for tee in self._tees:
            tee.transport.abort()
        self._tees.clear()

    def close(self) -> None:
        if self._listener is not None:
            self._listener.close()


@asynccontextmanager
async def socket_bus(_: pytest.MonkeyPatch, grippers: Mapping[int, SimulatedGripper]) -> AsyncIterator[Bus]:
    """A line behind a TCP socket."""
    async with AsyncExitStack() as stack:
        servers = {
            unit: RtuOverTcpSimulatorServer(gripper, device_id=unit) for unit, gripper in grippers.items()
        }
        for server in servers.values():
            await stack.enter_async_context(server)
        bus = _SocketBus(servers)
        await bus.plug()
        yield bus
        bus.close()
