"""The transport behind ``sim://``: a simulated gripper in this program, reached over real Modbus TCP."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from typing import TYPE_CHECKING, Final
from weakref import WeakValueDictionary

from ..values.enums import Finger
from ..values.errors import ConnectFailedError, ConnectionLostError, RobotiqConnectionError
from ..values.model import THREE_FINGER, Model
from ..values.registers import RegisterMap, Registers
from .address import Address, Simulation, parse_address
from .modbus import ModbusTransport

if TYPE_CHECKING:
    from ..simulator import SimulatedGripper


_GRIPPERS: Final[WeakValueDictionary[str, SimulatedGripper]] = WeakValueDictionary()


def new_gripper(simulation: Simulation, model: Model = THREE_FINGER) -> SimulatedGripper:
    """The gripper that a ``sim://`` address describes.

    Imports the simulator, which takes tens of milliseconds: only for sim://, and when the hand is made,
    because a later import would block the running loop.
    """
    from ..simulator import Physics, SimulatedGripper  # noqa: PLC0415
    from ..simulator.physics.driven_axis import mechanism_of  # noqa: PLC0415

    scene = simulation.physics
    # Another thread steps it: the loop must not wait.
    physics = None if scene is None else Physics(scene, threaded=True)
    gripper = SimulatedGripper(speedup=simulation.speedup, model=model, physics=physics)
    if physics is not None:
        mechanism_of(physics).stop()  # a server starts it: a hand that is never opened has no thread
    if simulation.object is not None:
        gripper.place_object(Finger.ABC, simulation.object)
    return gripper


def named(gripper: SimulatedGripper, address: Address) -> str:
    """The address of the hand that has this gripper: every ``sim://`` is another gripper."""
    name = f"{address}#{id(gripper):x}"
    _GRIPPERS[name] = gripper
    return name


def simulated(address: str) -> SimulatedGripper | None:
    """The gripper in this program behind the :attr:`~robotiq_async.hands.Hand.address` of a hand.

    For viewers that draw them. None for every other address: a real gripper, or a simulated gripper
    elsewhere.
    """
    return _GRIPPERS.get(address)


class SimulatedTransport:
    """Starts a simulator on loopback when opened. The gripper outlives the connection, as a real one."""

    has_current = True

    def __init__(
        self,
        gripper: SimulatedGripper,
        registers: RegisterMap,
        *,
        connect_timeout: float,
        response_timeout: float,
    ) -> None:
        from ..simulator import SimulatorServer  # noqa: PLC0415

        self._server = SimulatorServer(gripper)
        self._make = partial(
            ModbusTransport,
            registers=registers,
            connect_timeout=connect_timeout,
            response_timeout=response_timeout,
        )
        self._inner: ModbusTransport | None = None

    @property
    def is_open(self) -> bool:
        return self._inner is not None and self._inner.is_open

    @property
    def asked_at(self) -> float:
        # Also before it is open: a protocol's isinstance() reads every property.
        return -math.inf if self._inner is None else self._inner.asked_at

    async def open(self) -> None:
        """Start the simulator if it does not run, and connect to it."""
        if self._server.failure is not None:
            raise ConnectFailedError("sim://", str(self._server.failure)) from self._server.failure
        if self._inner is None:
            try:
                await self._server.start()
            except OSError as error:
                why = f"the simulated gripper cannot listen: {error.strerror or error}"
                raise ConnectFailedError("sim://", why) from error
            self._inner = self._make(parse_address(self._server.address))
        with self._explained():
            await self._inner.open()

    async def read(self) -> Registers:
        with self._explained():
            return await self._connected().read()

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        with self._explained():
            return await self._connected().send(decide)

    async def close(self) -> None:
        """Disconnect and stop the simulator's server; does nothing when closed."""
        inner, self._inner = self._inner, None
        if inner is not None:
            await inner.close()
        await self._server.stop()

    @contextmanager
    def _explained(self) -> Iterator[None]:
        """Raise the error of the gripper's bodies, which has ended the connection, instead of its error."""
        try:
            yield
        except RobotiqConnectionError as error:
            failure = self._server.failure
            if failure is None:
                raise
            raise ConnectionLostError(f"the simulated gripper: {failure}") from error

    def _connected(self) -> ModbusTransport:
        assert self._inner is not None, "opened before it is used"
        return self._inner
