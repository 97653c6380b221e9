"""The common part of servers on either kind of link: lifetime, gripper and misbehaviour."""

from __future__ import annotations

import asyncio
from abc import ABC, abstractmethod
from typing import TYPE_CHECKING, ClassVar, Self, cast

from robotiq_async.runtime.concurrency import in_a_thread, wait_shielded
from robotiq_async.values.model import THREE_FINGER

from ..physics.driven_axis import mechanism_of
from ..physics.gripper import SimulatedGripper
from ..troubles.corruption import ReplyPolicy, unchanged
from ..troubles.fault_injector import FaultInjector
from ..troubles.like_hardware import own_habits
from ..troubles.troubled_link import TroubledLink

if TYPE_CHECKING:
    from collections.abc import Collection, Sequence
    from types import TracebackType

    from ..physics.driven_axis import Mechanism, PhysicsError
    from ..troubles.trouble import TroubleLink
    from .connection import Connection
    from .responder import Responder


class SimulatorEndpoint(ABC):
    """A simulated gripper on a link.

    Attributes:
        gripper: the device that answers. It keeps its state when the server is stopped and started again. One
            that is not given takes 12 s for an activation.
        policy: changes, delays or drops each reply that no trouble concerns.
        fault_injector: makes troubles happen.
    """

    link: ClassVar[TroubleLink]
    functions: ClassVar[Collection[int]]
    """The Modbus functions that are served without any trouble."""
    _responds: ClassVar[type[Responder]]
    """Hears and answers the clients."""

    def __init__(self, gripper: SimulatedGripper | None, device_id: int | None) -> None:
        """``device_id`` is the only unit id that is answered; None for all."""
        self.gripper: SimulatedGripper = gripper or SimulatedGripper(habits=own_habits(THREE_FINGER))
        self.policy: ReplyPolicy = unchanged
        troubles = TroubledLink(self)
        self.fault_injector: FaultInjector = FaultInjector(self, troubles)
        self._responder = self._responds(self.gripper, troubles, self.functions, device_id)
        self._is_running = False

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
    def connections(self) -> Sequence[Connection]:
        """The open connections, oldest first."""
        return cast("Sequence[Connection]", tuple(self._responder.clients))

    @property
    def failure(self) -> PhysicsError | None:
        """The error that has ended the physics of the gripper, if one has; no client is answered then."""
        return self._responder.failure

    @property
    def failed(self) -> asyncio.Event:
        """Set with the failure."""
        return self._responder.failed

    @property
    @abstractmethod
    def address(self) -> str:
        """The address of this gripper, for a client."""

    @property
    def _query(self) -> str:
        """The end of the address, which names another model than the 3-Finger."""
        model = self.gripper.model
        return "" if model is THREE_FINGER else f"?model={model.name}"

    @property
    def _mechanism(self) -> Mechanism | None:
        """The bodies of this gripper, which move while a server of it runs."""
        physics = self.gripper.physics
        return None if physics is None else mechanism_of(physics)

    async def start(self) -> None:
        """Begin to answer.

        Raises:
            RuntimeError: it is running already.
            OSError: the address or the serial port cannot be opened.
        """
        if self._is_running:
            raise RuntimeError(f"{type(self).__name__} is running already, at {self.address}")
        await self._open()
        if self._mechanism is not None:
            self._mechanism.start()
        self._responder.open()
        self._is_running = True

    async def stop(self) -> None:
        """Drop all connections and stop listening. Bounded in time; without effect when it is not running.

        The thread of the gripper's physics has ended then, unless another server has the gripper, too.
        """
        if not self._is_running:
            return
        self._is_running = False
        self._close()
        self._responder.close()
        mechanism = self._mechanism
        ending = in_a_thread(mechanism.stop) if mechanism is not None and mechanism.threaded else None
        # Two turns of the loop, in which transports close their files.
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        if ending is not None:
            await wait_shielded(ending)

    def cut(self, *, reset: bool = False) -> None:  # noqa: ARG002
        """Drop all connections. Does nothing on a serial line."""
        self._check_running()

    def refuse(self) -> None:
        """Refuse new connections. Does nothing on a serial line."""
        self._check_running()

    async def accept(self) -> None:
        """Accept connections again. Does nothing on a serial line."""
        self._check_running()

    @abstractmethod
    async def _open(self) -> None:
        """Listen."""

    @abstractmethod
    def _close(self) -> None:
        """Listen no more; the connections are dropped afterwards."""

    def _check_running(self) -> None:
        if not self._is_running:
            raise RuntimeError(f"{type(self).__name__} is not running: start() comes first")
