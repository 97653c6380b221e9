"""Responder: hears and answers the clients of one simulated gripper, over any carrier of bytes."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, Final, Protocol

from robotiq_async.runtime.logger import log

from .framing import Frame, take_tcp, tcp_reply
from .register_bank import RegisterBank

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable

    from ..physics.driven_axis import PhysicsError
    from ..physics.gripper import SimulatedGripper
    from ..troubles.troubled_link import TroubledLink

_MOST_LEFT_OVER: Final = 100
"""Parts of replies that a multiplexer keeps for its next client."""


class Client(Protocol):
    """A connection to a client, as its responder uses it."""

    def pass_on(self, part: bytes) -> None:
        """Send bytes."""

    def hang_up(self, *, reset: bool = False) -> None:
        """Drop the connection."""


class Responder(ABC):
    """Takes the requests that connections have received, and makes their replies.

    Attributes:
        gripper: the device that answers.
        troubles: decide on requests and replies.
        clients: the present ones, oldest first.
        failure: the error that has ended the physics of the gripper, if one has; no client is answered then.
        failed: set with it.
    """

    def __init__(
        self,
        gripper: SimulatedGripper,
        troubles: TroubledLink,
        functions: Collection[int],
        unit: int | None,
    ) -> None:
        """``unit`` is the only unit id that is answered; None for all."""
        self.gripper: Final[SimulatedGripper] = gripper
        self.troubles: Final[TroubledLink] = troubles
        self.clients: Final[list[Client]] = []
        self.failure: PhysicsError | None = None
        self.failed: Final[asyncio.Event] = asyncio.Event()
        self._functions: Final = functions
        self._unit = unit
        self._is_open = False
        self._left_over: Final[deque[bytes]] = deque(maxlen=_MOST_LEFT_OVER)

    def open(self) -> None:
        """The server has begun to listen."""
        self._is_open = True

    def close(self) -> None:
        """The server listens no more: drop all clients."""
        self._is_open = False
        self.hang_up()
        self._left_over.clear()

    def hang_up(self, *, reset: bool = False) -> None:
        """Drop the connections that are there."""
        for client in tuple(self.clients):
            client.hang_up(reset=reset)

    # -- clients ---------------------------------------------------------------------------------------------

    def lets_in(self, client: Client) -> bool:
        """Take note of a client that has come; return whether it may stay."""
        self.clients.append(client)
        return self.failure is None and self.troubles.lets_in(len(self.clients) - 1)

    def forget(self, client: Client) -> None:
        """Take note that a client has gone."""
        if client in self.clients:
            self.clients.remove(client)
            self.troubles.left()

    def fail(self, error: PhysicsError) -> None:
        """Drop all clients for good: the gripper has no state any more to report."""
        if self.failure is None:
            self.failure = error
            self.failed.set()
            log.error("the simulated gripper answers no more: %s", error)
        self.hang_up(reset=True)

    # -- requests and replies --------------------------------------------------------------------------------

    @abstractmethod
    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of the bytes that have arrived; raises BadFrameError."""

    def hears(self, frame: Frame) -> bool:
        """Whether a request is heard, and meant for this gripper."""
        return self._is_meant(frame.unit) and self.troubles.hears()

    @abstractmethod
    def answer(self, frame: Frame) -> bytes:
        """Carry out a request; return the frame of the reply."""

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """The parts to send for a reply; None to hang up."""
        return self.troubles.deliver(reply)

    def undelivered(self, part: bytes) -> None:
        """Drop bytes for a client that is gone; a multiplexer keeps them for the newest or the next."""
        if not (self._is_open and self.troubles.is_multiplexed):
            return
        if self.clients:
            self.clients[-1].pass_on(part)
        else:
            self._left_over.append(part)

    def left_over(self) -> Iterable[bytes]:
        """Bytes that a new client gets before its first request."""
        parts = tuple(self._left_over) if self.troubles.is_multiplexed else ()
        self._left_over.clear()
        return parts

    def _is_meant(self, unit: int) -> bool:
        """Whether a request to a unit id is for this gripper."""
        return self._unit in (None, unit)


class ModbusResponder(Responder):
    """Answers Modbus from the registers of the gripper."""

    def answer(self, frame: Frame) -> bytes:
        bank = RegisterBank(self.gripper, self.troubles)
        return self._reply(frame, bank.answer(frame.pdu, self._functions))

    @abstractmethod
    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        """The frame of a reply to a request."""


class TcpResponder(ModbusResponder):
    """Answers Modbus TCP."""

    def take(self, inbox: bytearray) -> Frame | None:
        return take_tcp(inbox)

    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        return tcp_reply(frame, pdu)
