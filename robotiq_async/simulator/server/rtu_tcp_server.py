"""RtuOverTcpSimulatorServer: a simulated gripper on a serial line, behind a serial server."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotiq_async.values.checks import check_flag, check_int
from robotiq_async.values.registers import RTU_REGISTERS

from ..functions import RTU_FUNCTIONS
from .framing import Frame, rtu_reply, take_rtu
from .serial_connection import SerialConnection
from .serial_server import BROADCAST, is_answered
from .tcp_server import SimulatorServer

if TYPE_CHECKING:
    from collections.abc import Iterable

    from ..physics.gripper import SimulatedGripper


class RtuOverTcpSimulatorServer(SimulatorServer):
    """Serves a simulated gripper as a serial server does, or an arm's tool port: RTU frames in a TCP socket.

    It serves what :class:`~robotiq_async.simulator.SerialSimulatorServer` serves, at the speed of the
    line behind. Who sends one request after the other without waiting loses those that the line cannot take.
    """

    link = "rtu+tcp"
    functions = RTU_FUNCTIONS

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

    def take(self, inbox: bytearray) -> Frame | None:
        """Cut the next request out of what has arrived."""
        return take_rtu(inbox)

    def deliver(self, reply: bytes) -> Iterable[tuple[float, bytes]] | None:
        """What to send for a reply; nothing for an exception, and nothing to a broadcast."""
        return super().deliver(reply) if is_answered(reply) else ()

    def _is_meant(self, unit: int) -> bool:
        return unit == BROADCAST or super()._is_meant(unit)

    def _reply(self, frame: Frame, pdu: bytes) -> bytes:
        return rtu_reply(frame, pdu)

    def _connection(self) -> SerialConnection:
        return SerialConnection(self, paced=self.paced)
