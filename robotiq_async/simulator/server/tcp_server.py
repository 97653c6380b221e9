"""SimulatorServer: a simulated gripper behind Modbus TCP."""

from __future__ import annotations

import asyncio
import socket
from typing import TYPE_CHECKING, ClassVar, Final

from robotiq_async.values.checks import check_int, check_seconds

from ..functions import TCP_FUNCTIONS
from ..troubles.trouble import Trouble
from .connection import Connection
from .endpoint import SimulatorEndpoint
from .responder import Responder, TcpResponder

if TYPE_CHECKING:
    from ..physics.gripper import SimulatedGripper
    from ..troubles.trouble import TroubleLink

_LONGEST_OFF: Final = 3600.0


class SimulatorServer(SimulatorEndpoint):
    """Serves a simulated gripper over Modbus TCP, to any number of clients.

    Answers FC03, FC04, FC06 and FC16 at the addresses of
    :class:`~robotiq_async.simulator.server.register_bank.RegisterBank`;
    other functions, addresses and counts get the Modbus exceptions 1, 2 and 3. Bytes that are no Modbus TCP
    end the connection. Requests of one connection are answered in order; a client that does not take its
    replies is not read from until it does.
    """

    link: ClassVar[TroubleLink] = "tcp"
    functions: ClassVar[frozenset[int]] = TCP_FUNCTIONS
    _responds: ClassVar[type[Responder]] = TcpResponder

    def __init__(
        self,
        gripper: SimulatedGripper | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        device_id: int | None = None,
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            gripper: the device that answers; None for a new one.
            host: address to listen on.
            port: TCP port, 0 for any free one.
            device_id: the only unit id that is answered; None for all, as units in the field do.

        Raises:
            TypeError: port or device_id is not an int.
            ValueError: port is outside 0..65535, or device_id outside 0..255.
        """
        unit = None if device_id is None else check_int("device_id", device_id, 0, 255)
        super().__init__(gripper, unit)
        self._host = host
        self._port = check_int("port", port, 0, 65535)

    @property
    def port(self) -> int:
        """The TCP port; the one that was found free once the server has been started."""
        return self._port

    @property
    def address(self) -> str:
        """The address for :class:`~robotiq_async.RobotiqHand`."""
        return f"tcp://{self._host}:{self._port}{self._query}"

    def cut(self, *, reset: bool = False) -> None:
        """Drop all connections now; new ones are welcome.

        Args:
            reset: reset them (RST) instead of closing them in order (FIN).

        Raises:
            RuntimeError: the server is not running.
        """
        self._check_running()
        self._responder.hang_up(reset=reset)

    def refuse(self) -> None:
        """Refuse new connections until :meth:`accept`; present connections stay.

        Raises:
            RuntimeError: the server is not running.
        """
        self._check_running()
        self._listener.close()

    async def accept(self) -> None:
        """Accept connections again, on the same port; without effect when it does.

        Raises:
            RuntimeError: the server is not running.
            OSError: another process has taken the port.
        """
        self._check_running()
        if not self._listener.is_serving():
            await self._open()

    async def power_cycle(self, off_time: float = 0.0) -> None:
        """Cut the gripper's power and come back after it.

        Connections are dropped, new ones are refused until then, and the gripper comes back reset.

        Args:
            off_time: simulated seconds without power.

        Raises:
            RuntimeError: the server is not running.
            TypeError: off_time is not a number.
            ValueError: off_time is negative or above an hour.
        """
        seconds = check_seconds("off_time", off_time, 0, _LONGEST_OFF)
        self.cut()
        async with self.fault_injector.making(Trouble("power-cut")):
            await asyncio.sleep(seconds / self.gripper.speedup)

    def _connection(self) -> asyncio.Protocol:
        return Connection(self._responder)

    def _close(self) -> None:
        self._listener.close()

    async def _open(self) -> None:
        loop = asyncio.get_running_loop()
        try:
            self._listener = await loop.create_server(
                self._connection, self._host, self._port, reuse_address=True
            )
        except UnicodeError as error:  # the name cannot be a host name
            raise OSError(f"{self._host} cannot be resolved: {error}") from error
        if not self._listener.sockets:
            # asyncio takes every socket that cannot be made for one of a family that is not known here.
            self._listener.close()
            socket.socket().close()  # raises the reason
            raise OSError(f"there is no socket for {self._host}")
        self._port = self._listener.sockets[0].getsockname()[1]
