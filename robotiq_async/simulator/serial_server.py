"""SerialSimulatorServer: a simulated gripper behind Modbus RTU on a serial line."""

from __future__ import annotations

import asyncio
import importlib.util
from typing import TYPE_CHECKING

from pymodbus.server import ModbusSerialServer

from .bank import RegisterBank
from .connection import Connection
from .endpoint import SimulatorEndpoint
from .framing import Frame, take_rtu

if TYPE_CHECKING:
    from collections.abc import Iterable

    from .gripper import SimulatedGripper


class SerialSimulatorServer(SimulatorEndpoint):
    """Serves a simulated gripper over Modbus RTU at 115200 baud, 8N1.

    Serves what :class:`~robotiq_async.simulator.SimulatorServer` serves. The RTU gripper has no exception
    replies (manual), so a bad request gets no answer.
    """

    link = "rtu"

    def __init__(
        self, port: str, gripper: SimulatedGripper | None = None, *, device_id: int | None = None
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            port: the serial port, such as ``/dev/ttyUSB0``, or one end of a pseudo terminal.
            gripper: what answers; None for a new one.
            device_id: the only unit id that is answered (shipped grippers: 9); None for all.

        Raises:
            TypeError: device_id is not an int.
            ValueError: device_id is outside 0..255.
        """
        super().__init__(gripper, device_id)
        self._port = port

    @property
    def port(self) -> str:
        """The serial port."""
        return self._port

    @property
    def address(self) -> str:
        """The serial port as an address. A client needs the other end of the line, not this one."""
        return f"rtu://{self._port}"

    async def start(self) -> None:
        """Begin to answer.

        Raises:
            ImportError: pyserial is not installed.
            RuntimeError: it is running already.
            OSError: the serial port cannot be opened.
        """
        if importlib.util.find_spec("serial") is None:
            raise ImportError("a serial line needs pyserial: pip install 'robotiq-async[serial]'")
        await super().start()

    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""
        return take_rtu(inbox)

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """What to send for a reply; nothing for an exception."""
        return () if reply[1] & 0x80 else super().deliver(reply)

    async def _open(self) -> ModbusSerialServer:
        server = _SerialServer(self)
        # pymodbus's own listen() hides the error.
        server.transport, _ = await server.call_create()
        # The transport watches the line from the next turn of the loop on and tells the connection in the
        # one after that; closing it earlier would fail.
        await asyncio.sleep(0)
        await asyncio.sleep(0)
        return server


class _SerialServer(ModbusSerialServer):
    def __init__(self, endpoint: SerialSimulatorServer) -> None:
        super().__init__(
            RegisterBank(endpoint.gripper).device(),
            port=endpoint.port,
            baudrate=115200,
            bytesize=8,
            parity="N",
            stopbits=1,
        )
        self._endpoint = endpoint

    def callback_new_connection(self) -> Connection:
        return Connection(self, self._endpoint)
