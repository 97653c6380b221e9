"""What the servers on either kind of link have in common: life, gripper and misbehaviour."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, ClassVar, Final, Self

from robotiq_async.values.model import THREE_FINGER

from ..functions import READ_INPUT
from ..physics.gripper import SimulatedGripper
from ..troubles.corruption import ReplyPolicy, unchanged
from ..troubles.fault_injector import FaultInjector
from ..troubles.like_hardware import OWN_HABITS
from .connection import Connection

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from types import TracebackType

    from pymodbus.server.base import ModbusBaseServer

    from ..troubles.trouble import Link
    from .framing import Frame


_MOST_LEFT_OVER: Final = 100
"""Parts of replies that a multiplexer keeps for its next client."""


class SimulatorEndpoint(ABC):
    """A simulated gripper on a link.

    Attributes:
        gripper: what answers. It keeps its state when the server is stopped and started again. One that is
            not given takes 12 s for an activation.
        policy: changes, delays or drops each reply that no trouble concerns.
        fault_injector: makes troubles happen, and decides on requests and replies.
    """

    link: ClassVar[Link]
    functions: ClassVar[Collection[int]]
    """The Modbus functions that are served without any trouble."""

    def __init__(self, gripper: SimulatedGripper | None) -> None:
        self.gripper = SimulatedGripper(habits=OWN_HABITS) if gripper is None else gripper
        self.policy: ReplyPolicy = unchanged
        self.fault_injector = FaultInjector(self)
        self._server: ModbusBaseServer | None = None
        self._left_over: deque[bytes] = deque(maxlen=_MOST_LEFT_OVER)

    async def __aenter__(self) -> Self:
        await self.start()
        return self

    async def __aexit__(
        self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None
    ) -> None:
        await self.stop()

    @property
    def is_running(self) -> bool:
        """Whether the server has been started and not stopped."""
        return self._server is not None

    @property
    @abstractmethod
    def address(self) -> str:
        """What a client is given to find this gripper."""

    @property
    def _query(self) -> str:
        """The end of the address, which names another model than the 3-Finger."""
        model = self.gripper.model
        return "" if model is THREE_FINGER else f"?model={model.name}"

    async def start(self) -> None:
        """Begin to answer.

        Raises:
            RuntimeError: it is running already.
            OSError: the address or the serial port cannot be opened.
        """
        if self._server is not None:
            raise RuntimeError(f"{type(self).__name__} is running already, at {self.address}")
        self._server = await self._open()

    async def stop(self) -> None:
        """Drop all connections and stop listening. Bounded in time; without effect when it is not running."""
        server, self._server = self._server, None
        if server is None:
            return
        hang_up(server)
        server.close()
        self._left_over.clear()
        # Two turns of the loop: answers that pymodbus was working on end, and transports close their files.
        await asyncio.sleep(0)
        await asyncio.sleep(0)

    def cut(self, *, reset: bool = False) -> None:  # noqa: ARG002
        """Drop all connections. On a serial line there are none."""
        self._running()

    def refuse(self) -> None:
        """Refuse new connections. On a serial line there are none."""
        self._running()

    async def accept(self) -> None:
        """Accept connections again. On a serial line there are none."""
        self._running()

    @abstractmethod
    def _is_meant(self, unit: int) -> bool:
        """Whether a request to a unit id is for this gripper."""

    @abstractmethod
    async def _open(self) -> ModbusBaseServer:
        """A pymodbus server that listens."""

    def _running(self) -> ModbusBaseServer:
        if self._server is None:
            raise RuntimeError(f"{type(self).__name__} is not running: start() comes first")
        return self._server

    # What connections ask (see connection.Endpoint).

    @property
    def served_functions(self) -> Collection[int]:
        """The Modbus functions that are served now."""
        if self.fault_injector.reads_only_with_function_3:
            return set(self.functions) - {READ_INPUT}
        return self.functions

    def lets_in(self, client: Connection) -> bool:
        """Whether a client that has come may stay."""
        others = [] if self._server is None else connections(self._server)
        return self.fault_injector.lets_in(sum(each.is_active() for each in others if each is not client))

    @property
    def answers_nobody(self) -> bool:
        """Whether the gripper is without power."""
        return not self.gripper.is_powered

    @abstractmethod
    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""

    def hears(self, frame: Frame) -> bool:
        """Whether a request is heard, and meant for this gripper."""
        return self._is_meant(frame.unit) and self.fault_injector.hears()

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """What to send for a reply."""
        return self.fault_injector.deliver(reply)

    def undelivered(self, part: bytes) -> None:
        """Lose what a client that is gone was to be sent; a multiplexer has it for the newest or the next."""
        if self._server is None or not self.fault_injector.is_multiplexed:
            return
        present = [each for each in connections(self._server) if each.is_active()]
        if present:
            present[-1].pass_on(part)
        else:
            self._left_over.append(part)

    def left_over(self) -> Iterable[bytes]:
        """What a new client is sent before it has asked for anything."""
        parts = tuple(self._left_over) if self.fault_injector.is_multiplexed else ()
        self._left_over.clear()
        return parts


def hang_up(server: ModbusBaseServer, *, reset: bool = False) -> None:
    """Drop all connections of a server."""
    for connection in connections(server):
        connection.hang_up(reset=reset)


def connections(server: ModbusBaseServer) -> list[Connection]:
    """The connections of a server, oldest first."""
    return [each for each in server.active_connections.values() if isinstance(each, Connection)]
