"""The common part of servers on either kind of link: lifetime, gripper and misbehaviour."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from collections import deque
from typing import TYPE_CHECKING, ClassVar, Final, Self

from robotiq_async.runtime.concurrency import in_a_thread, wait_shielded
from robotiq_async.runtime.log import log
from robotiq_async.values.model import THREE_FINGER

from ..physics.gripper import SimulatedGripper
from ..troubles.corruption import Reply, ReplyPolicy, unchanged
from ..troubles.fault_injector import FaultInjector
from ..troubles.like_hardware import own_habits
from .connection import Connection
from .register_bank import RegisterBank

if TYPE_CHECKING:
    from collections.abc import Collection, Iterable
    from types import TracebackType

    from ..physics.driven_axis import PhysicsError
    from ..troubles.trouble import Link
    from .framing import Frame


_MOST_LEFT_OVER: Final = 100
"""Parts of replies that a multiplexer keeps for its next client."""


class SimulatorEndpoint(ABC):
    """A simulated gripper on a link.

    Attributes:
        gripper: the device that answers. It keeps its state when the server is stopped and started again. One
            that is not given takes 12 s for an activation.
        policy: changes, delays or drops each reply that no trouble concerns.
        fault_injector: makes troubles happen, and decides on requests and replies.
        connections: to the clients that are there, oldest first.
        failure: the error that has ended the physics of the gripper, if one has; no client is answered then.
        failed: set with it.
    """

    link: ClassVar[Link]
    functions: ClassVar[Collection[int]]
    """The Modbus functions that are served without any trouble."""

    def __init__(self, gripper: SimulatedGripper | None) -> None:
        self.gripper: SimulatedGripper = gripper or SimulatedGripper(habits=own_habits(THREE_FINGER))
        self.policy: ReplyPolicy = unchanged
        self.fault_injector: FaultInjector = FaultInjector(self)
        self.connections: list[Connection] = []
        self.failure: PhysicsError | None = None
        self.failed: asyncio.Event = asyncio.Event()
        self._bank = RegisterBank(self.gripper, self.fault_injector)
        self._is_running = False
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
        return self._is_running

    @property
    @abstractmethod
    def address(self) -> str:
        """The address by which a client finds this gripper."""

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
        if self._is_running:
            raise RuntimeError(f"{type(self).__name__} is running already, at {self.address}")
        await self._open()
        if self.gripper.physics is not None:
            self.gripper.physics.start()
        self._is_running = True

    async def stop(self) -> None:
        """Drop all connections and stop listening. Bounded in time; without effect when it is not running.

        The thread of the gripper's physics has ended then, unless another server has the gripper, too.
        """
        if not self._is_running:
            return
        self._is_running = False
        self._close()
        self._hang_up()
        self._left_over.clear()
        physics = self.gripper.physics
        ending = in_a_thread(physics.stop) if physics is not None and physics.threaded else None
        # Two turns of the loop, in which transports close their files.
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        if ending is not None:
            await wait_shielded(ending)

    def cut(self, *, reset: bool = False) -> None:  # noqa: ARG002
        """Drop all connections. On a serial line there are none."""
        self._check_running()

    def refuse(self) -> None:
        """Refuse new connections. On a serial line there are none."""
        self._check_running()

    async def accept(self) -> None:
        """Accept connections again. On a serial line there are none."""
        self._check_running()

    @abstractmethod
    def _is_meant(self, unit: int) -> bool:
        """Whether a request to a unit id is for this gripper."""

    @abstractmethod
    async def _open(self) -> None:
        """Listen."""

    @abstractmethod
    def _close(self) -> None:
        """Listen no more; the connections are dropped afterwards."""

    @abstractmethod
    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        """The frame of a reply to a request."""

    def _check_running(self) -> None:
        if not self._is_running:
            raise RuntimeError(f"{type(self).__name__} is not running: start() comes first")

    def _hang_up(self, *, reset: bool = False) -> None:
        for connection in tuple(self.connections):
            connection.hang_up(reset=reset)

    # Called by connections.

    def lets_in(self, client: Connection) -> bool:
        """Take note of a client that has come; return whether it may stay."""
        self.connections.append(client)
        return self.failure is None and self.fault_injector.lets_in(len(self.connections) - 1)

    def forget(self, client: Connection) -> None:
        """Take note that a client has gone."""
        if client in self.connections:
            self.connections.remove(client)

    @abstractmethod
    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""

    def hears(self, frame: Frame) -> bool:
        """Whether a request is heard, and meant for this gripper."""
        return self._is_meant(frame.unit) and self.fault_injector.hears()

    def answer(self, frame: Frame) -> bytes:
        """Carry out a request; return the frame of the reply."""
        return self._reply(frame, self._bank.answer(frame.pdu, self.functions))

    def fail(self, error: PhysicsError) -> None:
        """Drop all clients for good: the gripper has no state any more that could be told."""
        if self.failure is None:
            self.failure = error
            self.failed.set()
            log.error("the simulated gripper answers no more: %s", error)
        self._hang_up(reset=True)

    def as_reply(self, frame: bytes) -> Reply:
        """A reply in the form for troubles."""
        return Reply(frame, serial=self.link != "tcp")

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """The parts to send for a reply."""
        return self.fault_injector.deliver(reply)

    def undelivered(self, part: bytes) -> None:
        """Drop bytes for a client that is gone; a multiplexer keeps them for the newest or the next."""
        if not (self._is_running and self.fault_injector.is_multiplexed):
            return
        if self.connections:
            self.connections[-1].pass_on(part)
        else:
            self._left_over.append(part)

    def left_over(self) -> Iterable[bytes]:
        """Bytes that a new client gets before its first request."""
        parts = tuple(self._left_over) if self.fault_injector.is_multiplexed else ()
        self._left_over.clear()
        return parts
