"""The link to one gripper over Modbus: TCP, a serial line, or a serial line behind a socket.

pymodbus's asynchronous client opens and closes the connection (wires.py). The exchanges on it are made here,
because a client that may retry, reconnect or accept a doubtful reply could send a motion twice: dialogue.py
has the requests, line.py their time, and exchange.py and frames.py judge the replies.

* Transaction ids start at random and continue over connections, so that a reply left over from an earlier
  connection is recognised. They repeat after 65,535 requests.
* Timeouts come from a watchdog that looks once in a while (watchdog.py). ``asyncio.wait_for`` costs more, on
  Python 3.11 swallows a cancellation that lands together with the reply, and takes a blocked loop for silence
  although the reply is waiting in the socket.
* Foreign exceptions stop in the wires.
"""

from __future__ import annotations

import secrets
from collections.abc import Coroutine
from itertools import count
from typing import Any, Final

from ..runtime.logger import Log, log
from ..values.registers import RegisterMap, Registers
from .address import Address
from .dialogue import Decide, Dialogues, MakeExchange
from .exchange import Exchange, PduExchange, SerialExchange, TcpExchange, Timing
from .frames import tcp_frame
from .line import Line
from .transport import WriteAnswer
from .tunnel.protocol import Tunnel, tunnel_to
from .tunnel.wire import TunnelWire

LAST_NUMBER: Final = 0xFFFF
"""Transaction ids are 1 to this."""


class ModbusTransport:
    """A gripper behind Modbus.

    Attributes:
        dialogues: those with it, and the number of reads that were repeated.
    """

    has_current = True

    def __init__(
        self,
        address: Address,
        registers: RegisterMap,
        *,
        connect_timeout: float,
        response_timeout: float,
        shares_line: bool = False,
        tunnel: Tunnel | None = None,
        log: Log = log,
    ) -> None:
        """Keep the settings; opens nothing.

        The address is tcp, rtu, rtu+tcp or tunnel; ``tunnel`` is made from the address unless given. Timeouts
        are in seconds; on a serial line a read may be repeated after ``response_timeout``. With
        ``shares_line``, others of the event loop may use the serial line, too, for grippers with other ids.
        """
        self._connect_timeout: Final = connect_timeout
        self._shares_line: Final = shares_line
        if tunnel is None and address.scheme:
            tunnel = tunnel_to(address, registers.device_id)
        self._tunnel: Final = None if tunnel is None else TunnelWire(tunnel, address, log)
        self._log: Final = log
        self._numbers: Final = count(secrets.randbelow(LAST_NUMBER))
        """For the transaction ids; start at random to differ from those of other programs."""
        make: MakeExchange = self._over_a_line if address.is_rtu else self._over_tcp
        line = Line(address, wire=self._tunnel)
        make = make if tunnel is None else PduExchange
        self.dialogues: Final = Dialogues(line, registers, make, response_timeout, log)

    def _over_tcp(self, request: bytes, timing: Timing) -> Exchange:
        # Never with the number 0, which some devices answer to anything.
        return TcpExchange(tcp_frame(next(self._numbers) % LAST_NUMBER + 1, request), timing)

    def _over_a_line(self, request: bytes, timing: Timing) -> Exchange:
        return SerialExchange(request, timing, self.dialogues.line.echo, has_others=self._shares_line)

    @property
    def is_open(self) -> bool:
        return self in self.dialogues.line.users

    @property
    def asked_at(self) -> float:
        return self.dialogues.line.asked_at

    @property
    def is_shared(self) -> bool:
        return self.dialogues.line.is_shared

    @property
    def echoes(self) -> bool:
        """Whether the line was seen to echo requests; the echo is dropped."""
        return bool(self.dialogues.line.echo.is_on)

    @property
    def reads_with_writes(self) -> bool:
        return self.dialogues.serves_23 is not False

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier request is taken for one to come.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            ProtocolError: the reply is not an answer, or bytes arrive without a request.
            ConnectionLostError: the connection was closed at once.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        self.dialogues.line.leave(self)
        if self._shares_line:
            self.dialogues.move_to(Line.shared(self.dialogues.line.address))
        await self.dialogues.line.open(self, self._connect_timeout, self._log)
        await self.dialogues.line.talk(self, self.dialogues.opening())

    # Each poll makes one of these calls: no coroutine of their own, which would cost as much as the request.

    def read(self) -> Coroutine[Any, Any, Registers]:
        return self.dialogues.line.talk(self, self.dialogues.read())

    def send(self, decide: Decide) -> Coroutine[Any, Any, bool]:
        """Write the image that ``decide`` returns, if any, with one function 16; a jaw has three registers.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        return self.dialogues.line.talk(self, self.dialogues.write(decide))

    def send_and_read(self, decide: Decide) -> Coroutine[Any, Any, WriteAnswer | None]:
        """Write the image that ``decide`` returns, if any, and read the status, with function 23.

        Raises:
            RobotiqConnectionError: no clean answer in time, and no status after it; the transport is closed.
        """
        return self.dialogues.line.talk(self, self.dialogues.write_and_read(decide))

    def stop_or_read(self, decide: Decide) -> Coroutine[Any, Any, Registers | None]:
        """Write the image that ``decide`` returns when the turn comes, if any; else read the status.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        return self.dialogues.line.talk(self, self.dialogues.stop_or_read(decide))

    async def close(self) -> None:
        """Disconnect; does nothing when closed. Waits for a tunnel to close, half a second at most."""
        self.dialogues.line.release(self)
        if self._tunnel is not None:
            await self._tunnel.closed()
