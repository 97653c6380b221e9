"""A simulated gripper behind Modbus RTU: on a serial line, or behind a serial server."""

from __future__ import annotations

import asyncio
import importlib.util
from typing import TYPE_CHECKING, Final

from pymodbus.transport.serialtransport import create_serial_connection

from robotiq_async.values.checks import check_flag, check_int
from robotiq_async.values.registers import RTU_REGISTERS

from ..functions import RTU_FUNCTIONS
from .endpoint import SimulatorEndpoint
from .framing import Frame, rtu_reply, take_rtu
from .serial_connection import BAUD, SerialConnection
from .tcp_server import SimulatorServer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..physics.gripper import SimulatedGripper


_BROADCAST: Final = 0


class _RtuEndpoint(SimulatorEndpoint):
    """What is the same for RTU frames, whatever carries them."""

    functions = RTU_FUNCTIONS

    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""
        return take_rtu(inbox)

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """What to send for a reply; nothing for an exception (manual), and nothing to a broadcast."""
        is_exception = bool(reply[1] & 0x80)
        return () if is_exception or reply[0] == _BROADCAST else super().deliver(reply)

    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        return rtu_reply(frame, pdu)


class SerialSimulatorServer(_RtuEndpoint):
    """Serves a simulated gripper over Modbus RTU at 115200 baud, 8N1.

    Bytes take the time that they take at that rate, both ways, and a request the silence that ends it: a
    read 4.3 ms, a write 4.6 ms. Timers make that longer by up to a millisecond, and never shorter.

    Serves what :class:`~robotiq_async.simulator.SimulatorServer` serves, and FC23, which writes before it
    reads. The RTU gripper has no exception replies (manual), so a bad request gets no answer. Broadcasts
    (unit 0) are carried out and not answered, requests to other units are left to them, as Modbus has it;
    no source says what a real gripper does with a broadcast.
    """

    link = "rtu"

    def __init__(
        self,
        port: str,
        gripper: SimulatedGripper | None = None,
        *,
        device_id: int = RTU_REGISTERS.device_id,
        paced: bool = True,
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            port: the serial port, such as ``/dev/ttyUSB0``, or one end of a pseudo terminal.
            gripper: what answers; None for a new one.
            device_id: the unit id of the gripper.
            paced: whether bytes take their time. False for a real serial port, which takes it itself, and for
                programs that have no time.

        Raises:
            TypeError: device_id is not an int, or paced is not a bool.
            ValueError: device_id is outside 1..247.
        """
        super().__init__(gripper)
        self._device_id = check_int("device_id", device_id, 1, 247)
        self._port = port
        self._paced = check_flag("paced", paced)

    @property
    def port(self) -> str:
        """The serial port."""
        return self._port

    @property
    def address(self) -> str:
        """The serial port as an address. A client needs the other end of the line, not this one."""
        return f"rtu://{self._port}{self._query}"

    async def start(self) -> None:
        """Begin to answer.

        Raises:
            ImportError: pyserial is not installed.
            RuntimeError: it is running already.
            OSError: the serial port cannot be opened.
        """
        if importlib.util.find_spec("serial") is None:
            from robotiq_async.runtime.extras import install  # noqa: PLC0415  # nothing else needs it

            raise ImportError(f"a serial line needs pyserial: {install('serial')}")
        await super().start()

    @property
    def paced(self) -> bool:
        """Whether bytes take their time."""
        return self._paced

    def _is_meant(self, unit: int) -> bool:
        return unit in (_BROADCAST, self._device_id)

    def _close(self) -> None:
        """There is nothing but the one connection."""

    async def _open(self) -> None:
        loop, line = asyncio.get_running_loop(), {"bytesize": 8, "parity": "N", "stopbits": 1}
        await create_serial_connection(
            loop, lambda: SerialConnection(self, paced=self._paced), self._port, baudrate=BAUD, **line
        )
        # The transport watches the line from the next turn of the loop on and tells the connection in the
        # one after that; closing it earlier would fail.
        await asyncio.sleep(0)
        await asyncio.sleep(0)


class RtuOverTcpSimulatorServer(_RtuEndpoint, SimulatorServer):
    """Serves a simulated gripper as a serial server does, or an arm's tool port: RTU frames in a TCP socket.

    It serves what :class:`~robotiq_async.simulator.SerialSimulatorServer` serves, at the speed of the
    line behind. Who sends one request after the other without waiting loses those that the line cannot take.
    """

    link = "rtu+tcp"

    def __init__(
        self,
        gripper: SimulatedGripper | None = None,
        *,
        host: str = "127.0.0.1",
        port: int = 0,
        device_id: int = RTU_REGISTERS.device_id,
        paced: bool = True,
    ) -> None:
        """A server that is not started; needs no running loop.

        Args:
            gripper: what answers; None for a new one.
            host: address to listen on.
            port: TCP port, 0 for any free one.
            device_id: the unit id of the gripper.
            paced: whether bytes take the time that they take on the line.

        Raises:
            TypeError: port or device_id is not an int, or paced is not a bool.
            ValueError: port is outside 0..65535, or device_id outside 1..247.
        """
        super().__init__(gripper, host=host, port=port, device_id=check_int("device_id", device_id, 1, 247))
        self.paced = check_flag("paced", paced)

    @property
    def address(self) -> str:
        """The address for :class:`~robotiq_async.RobotiqHand`."""
        return f"rtu+{super().address}"

    def _is_meant(self, unit: int) -> bool:
        return unit == _BROADCAST or super()._is_meant(unit)

    def _connection(self) -> SerialConnection:
        return SerialConnection(self, paced=self.paced)
