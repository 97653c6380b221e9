"""The link to one gripper: reads and writes over pymodbus.

This module and pdus.py are the only ones of the client that use it.

pymodbus does the framing and the transport; what it leaves to its user is done here:

* One client object per connection, no retries and no reconnecting of its own: both would send a motion
  twice.
* Every byte that arrives is checked before pymodbus sees it (frames.py). Anything but the whole right
  answer, in time, ends the exchange *and* the connection: on a link that is out of step the next reply
  could be the answer to this request.
* Transaction ids are ours. pymodbus begins at 1 on every connection, so that a reply left over from an
  earlier one would be taken for an answer. Here they begin anywhere, go on over connections, and come again
  after 65,535 requests.
* Timeouts are a watchdog of ours that looks once in a while. pymodbus's own is ``asyncio.wait_for``,
  which on Python 3.11 swallows a cancellation that lands together with the reply, and which a loop that
  was held up takes for silence although the reply is waiting in the socket.
* Foreign exceptions stop here.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import secrets
import sys
from collections.abc import Sequence
from typing import Any, Final

import anyio
from pymodbus import FramerType
from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.exceptions import ModbusException
from pymodbus.pdu import ModbusPDU

from ..errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from ..wire.registers import REGISTER_COUNT, RegisterMap, Registers
from .address import Address
from .frames import Expected, expected_reply, show
from .host_names import addresses_of, why_no_socket, why_unreachable
from .pdus import ReadRequest, WriteRequest, register
from .serial_ports import why_no_port

# pymodbus logs its send and receive history at ERROR on every timeout; what matters of it is said in our
# exceptions. Whoever sets a level on its logger gets what they ask for.
_pymodbus_log = logging.getLogger("pymodbus.logging")
if _pymodbus_log.level == logging.NOTSET:
    _pymodbus_log.setLevel(logging.CRITICAL + 1)

LARGEST_READ: Final = 4096
"""Bytes taken from the socket at a time; the longest Modbus frame has 260."""
LAST_NUMBER: Final = 0xFFFF
"""Transaction ids are 1 to this."""
SETTLE_S: Final = 0.02
"""From connecting to the first request over TCP: a few round trips of a network in a building."""
HELD_S: Final = 0.01
"""A timer, or a tick, that comes so late was kept from coming: the loop was held up."""
GRACE_S: Final = 0.02
"""A peer in the same loop (the simulated gripper) was held up with it, and gets so much more time."""


class _ExchangeEndedError(Exception):
    """Carries the reason through pymodbus, which would take a TimeoutError for its own."""

    def __init__(self, reason: RobotiqConnectionError) -> None:
        self.reason = reason
        super().__init__(str(reason))


class ModbusTransport:
    """A gripper behind Modbus TCP or a serial line (Modbus RTU)."""

    def __init__(
        self,
        address: Address,
        registers: RegisterMap,
        *,
        connect_timeout: float,
        response_timeout: float,
    ) -> None:
        """Keep what is needed to connect; opens nothing.

        Args:
            address: a tcp or rtu address.
            registers: where the blocks lie, and the device id.
            connect_timeout: seconds for connecting.
            response_timeout: seconds for one answer.
        """
        self._address = address
        self._map = registers
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._serial = address.kind == "rtu"
        self._client: AsyncModbusTcpClient | AsyncModbusSerialClient | None = None
        self._expected: Expected | None = None
        self._failure: RobotiqConnectionError | None = None
        self._number = secrets.randbelow(LAST_NUMBER)
        """The transaction id of the last request; another program's are others, most likely."""
        self._their_number = b""
        """pymodbus's own transaction id of the request in flight."""
        self._probe = 0
        self._poll = ReadRequest(registers)
        self._loop: asyncio.AbstractEventLoop
        self._due = 0.0
        """When the exchange in flight must be over, in the loop's time."""
        self._has_grace = False
        self._watchdog: asyncio.TimerHandle | None = None

    @property
    def is_open(self) -> bool:
        """Whether requests can be sent."""
        return self._client is not None

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier request is taken for one to come.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            ProtocolError: somebody answers, but not what was asked; or bytes come that nobody asked for.
            ConnectionLostError: it was closed again at once.
            ResponseTimeoutError: it can be opened, but nobody answers.
        """
        await self.close()
        self._loop = asyncio.get_running_loop()
        self._failure = self._expected = None
        try:
            with anyio.fail_after(self._connect_timeout):
                client = await self._connect()
        except TimeoutError:
            raise ConnectFailedError(
                str(self._address), f"no connection within {self._connect_timeout:g} s"
            ) from None
        self._client = client
        # asyncio asks the system for 256 KiB at a time, and taking and giving back that much memory costs
        # several times what a reply does. Undocumented: where it is called otherwise, nothing is saved.
        with contextlib.suppress(AttributeError):
            client.ctx.transport.max_size = LARGEST_READ  # type: ignore[attr-defined]
        if not self._serial:
            await self._settle()
        await self._resynchronise()

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        return tuple((await self._exchange(self._poll)).registers)

    async def write(self, registers: Sequence[int]) -> None:
        """Write the eight request registers with one FC16, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        await self._exchange(WriteRequest(self._map, registers))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._drop()

    # -- one exchange ----------------------------------------------------------------------------------

    def _connected(self) -> AsyncModbusTcpClient | AsyncModbusSerialClient:
        if self._failure is not None:
            # The link broke, or something arrived that nobody had asked for, between two requests.
            failure, self._failure = self._failure, None
            self._drop()
            raise failure
        if self._client is None:
            raise ConnectionLostError(f"not connected to {self._address}")
        return self._client

    async def _exchange(self, request: ModbusPDU) -> ModbusPDU:
        """Send one request and wait for its answer; on anything else the connection is given up."""
        client = self._connected()
        self._watch()
        try:
            response: ModbusPDU = await client.execute(False, request)
        except _ExchangeEndedError as ended:
            self._drop()
            raise ended.reason from None
        except ModbusException as error:
            self._drop()
            raise ConnectionLostError(str(error)) from error
        except OSError as error:
            self._drop()
            raise ConnectionLostError(f"{self._address}: {error}") from error
        except BaseException:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._drop()
            raise
        finally:
            self._expected = None
        return response

    def _watch(self) -> None:
        """Fail the exchange that begins now when it takes too long.

        Setting a timer for each exchange and cancelling it costs more than the exchange's own Python. So
        one timer stands until it expires, and then looks when the exchange of that moment is due.
        """
        loop = self._loop
        self._due = loop.time() + self._response_timeout
        self._has_grace = False
        if self._watchdog is None:
            self._watchdog = loop.call_at(self._due, self._look, self._due)

    def _look(self, when: float) -> None:
        """The watchdog's timer has expired.

        A loop that was held up reads before it looks at its timers: a reply that was waiting is in time.
        """
        self._watchdog = None
        client = self._client
        if client is None or self._expected is None or client.ctx.response_future.done():
            return
        now = self._loop.time()
        if now >= self._due and now - when > HELD_S and not self._has_grace:
            self._due, self._has_grace = now + GRACE_S, True
        if now < self._due:
            self._watchdog = self._loop.call_at(self._due, self._look, self._due)
        else:
            waited = f"{self._response_timeout:g} s"
            self._fail(ResponseTimeoutError(f"{self._address} did not answer within {waited}"))

    def _fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange in flight with an error; without one, keep the error for the next."""
        client = self._client
        if client is not None and self._expected is not None and not client.ctx.response_future.done():
            client.ctx.response_future.set_exception(_ExchangeEndedError(error))
        elif self._failure is None:
            self._failure = error

    def _drop(self) -> None:
        client, self._client = self._client, None
        watchdog, self._watchdog = self._watchdog, None
        if watchdog is not None:
            watchdog.cancel()
        if client is not None:
            client.close()

    # -- what pymodbus calls ---------------------------------------------------------------------------

    def _trace_packet(self, sending: bool, data: bytes) -> bytes:
        """Every frame that is sent, and the bytes received so far for one: returns what goes on from here."""
        if sending:
            frame = data if self._serial else self._numbered(data)
            self._expected = expected_reply(frame, serial=self._serial)
            return frame
        try:
            if self._expected is None:
                raise ProtocolError(f"{len(data)} bytes that nobody asked for: {show(data)}")
            complete = self._expected.is_complete(data)
        except ProtocolError as error:
            self._fail(error)
            return b""
        if not complete:
            return b""
        return data if self._serial else self._their_number + data[len(self._their_number) :]

    def _numbered(self, frame: bytes) -> bytes:
        """The frame with a transaction id of ours; 0 is none, some devices answer it to anything."""
        self._number = self._number % LAST_NUMBER + 1
        self._their_number, rest = frame[:2], frame[2:]
        return self._number.to_bytes(2, "big") + rest

    def _trace_connect(self, connected: bool) -> None:
        if not connected:
            self._fail(ConnectionLostError(f"{self._address} closed the connection"))

    # -- connecting ------------------------------------------------------------------------------------

    async def _connect(self) -> AsyncModbusTcpClient | AsyncModbusSerialClient:
        """A client that is connected, to the first address of the host that can be reached."""
        reasons: list[OSError] = []
        for host in await self._hosts():
            client, connected = self._make_client(host), False
            # pymodbus drops what does not fit without a word; whatever comes is for frames.py to judge.
            client.ctx.max_buffer_size = sys.maxsize
            _keep_reasons(client, reasons)
            try:
                connected = await client.connect()
            except Exception as error:
                raise ConnectFailedError(str(self._address), str(error)) from error
            finally:
                if not connected:
                    client.close()
            if connected:
                return client
        last = reasons[-1] if reasons else None
        why = why_no_port(last) if self._serial else why_no_socket() or why_unreachable(last)
        raise ConnectFailedError(str(self._address), why) from last

    async def _hosts(self) -> list[str]:
        if self._serial:
            return [self._address.host]
        try:
            return await addresses_of(self._address.host, self._address.port)
        except (OSError, UnicodeError) as error:
            why = f"the name cannot be resolved: {getattr(error, 'strerror', None) or error}"
            raise ConnectFailedError(str(self._address), why) from error

    def _make_client(self, host: str) -> AsyncModbusTcpClient | AsyncModbusSerialClient:
        # timeout=None: wait_for becomes a plain await, and the watchdogs above are the only timeouts.
        options: dict[str, Any] = {
            "retries": 0,
            "reconnect_delay": 0,
            "timeout": None,
            "trace_packet": self._trace_packet,
            "trace_connect": self._trace_connect,
        }
        if not self._serial:
            tcp = AsyncModbusTcpClient(host, port=self._address.port, **options)
            register(tcp)
            return tcp
        try:
            import serial  # noqa: F401, PLC0415
        except ImportError:
            raise ConnectFailedError(
                str(self._address), "serial ports need pyserial: pip install 'robotiq-async[serial]'"
            ) from None
        line = AsyncModbusSerialClient(
            host,
            framer=FramerType.RTU,
            baudrate=115200,
            bytesize=8,
            parity="N",
            stopbits=1,
            **options,
        )
        register(line)
        return line

    async def _settle(self) -> None:
        """Give what is left over from an earlier connection time to show itself before anything is asked.

        A gateway that keeps its own connection to the gripper may send late replies to whoever connects
        next. Their numbers tell as well; but by then a request of ours is on its way, whose reply would be
        left over for the next connection, and so on without end.
        """
        try:
            await asyncio.sleep(SETTLE_S)
        except BaseException:
            self._drop()
            raise
        self._connected()

    async def _resynchronise(self) -> None:
        """Make sure that no answer to an earlier request is still on its way.

        Serial replies carry no number, and a gateway from TCP to a serial line gives a late one the number
        of what it is asked next. So after opening, one to seven registers are read instead of eight, a
        different count each time: a late answer has another length and is found out, and the gripper
        answers in order, so that once the right length is back nothing older can follow.
        """
        self._probe = self._probe % (REGISTER_COUNT - 1) + 1
        await self._exchange(ReadRequest(self._map, self._probe))


def _keep_reasons(client: AsyncModbusTcpClient | AsyncModbusSerialClient, reasons: list[OSError]) -> None:
    """Add to a list why a client could not connect, which pymodbus keeps to itself."""
    create = client.ctx.call_create

    async def created() -> object:
        try:
            return await create()
        except OSError as error:
            reasons.append(error)
            raise

    client.ctx.call_create = created
