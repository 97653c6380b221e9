"""Wires carry the bytes of a line: sockets and serial ports, which pymodbus's clients open and close.

All that this package knows of the inside of a pymodbus client is here. A client is made for each connection,
without retries and without reconnecting. Its receiver is replaced before the first byte can arrive: its
buffer silently drops bytes that do not fit, and its framer accepts replies that frames.py refuses. Its
connect() only logs why it fails; the call inside it raises that.

Serial ports are read and written by descriptor. pyserial's read() waits with select(), which refuses
descriptors of 1024 and above, and its write() tries again in a busy loop while the port takes no more. Ports
without a descriptor, as on Windows, are left to pymodbus.

Exceptions of the system and of packages become a ConnectFailedError; each call has a table of reasons.
"""

from __future__ import annotations

import asyncio
import contextlib
import os
import socket
from collections.abc import Callable, Iterator, Mapping
from functools import partial
from typing import Any, Final, Protocol

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient

from ..runtime.extras import install
from ..runtime.host_names import addresses_of, why_no_socket, why_unreachable
from ..runtime.limit import Limit
from ..values.errors import ConnectFailedError, ConnectionLostError, RobotiqConnectionError
from .address import Address
from .outcome import Lost, Outcome
from .serial.ports import GONE, hasten, why_no_port

ModbusClient = AsyncModbusTcpClient | AsyncModbusSerialClient
AsyncioTransport = Any
"""Of a connection: one of asyncio's, or pymodbus's for serial ports, which is not typed."""
Send = Callable[[bytes], None]
OnData = Callable[[bytes], None]
OnEnd = Callable[[Outcome], None]

LARGEST_READ: Final = 4096  # bytes read at a time; the longest Modbus frame has 260
KEEPALIVE: Final = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 5}
"""TCP keepalive: seconds of silence before the first probe, seconds between probes, probes without an answer.
A polling hand is never that silent. But while its program is suspended (a debugger, a sleeping machine),
nothing else shows either end that the other is gone."""

ErrorTable = Mapping[type[Exception], Callable[[Any], str]]
"""The reason to show for each kind of error that a call may raise; the first kind that fits counts. An error
that is not in the table is its own reason."""
RESOLVING: Final[ErrorTable] = {
    # Of the system; or it is no host name, or there is no thread for it.
    Exception: lambda error: f"the name cannot be resolved: {getattr(error, 'strerror', None) or error}",
}
CONNECTING: Final[ErrorTable] = {OSError: lambda error: why_no_socket() or why_unreachable(error)}
OPENING_ERRORS: Final[ErrorTable] = {
    ImportError: lambda _: f"serial ports need pyserial: {install('serial')}",
    OSError: why_no_port,
}


class Wire(Protocol):
    """The carrier of a line's frames. It may be opened again after it was closed."""

    async def open(self, on_data: OnData, on_end: OnEnd, seconds: float) -> Send:
        """Connect; return a function that sends a frame.

        The function never blocks, and raises OSError when the wire has ended. The caller closes the wire,
        also if this call has failed.

        Args:
            on_data: gets all bytes, from the first one on.
            on_end: gets the reason when the wire has ended by itself, or when a request on it has ended
                without an answer.
            seconds: for how long the caller waits; it cancels the call then.

        Raises:
            ConnectFailedError: it cannot be opened, for any reason.
        """

    def close(self) -> None:
        """Close it at once; does nothing when closed."""


@contextlib.contextmanager
def failing_as(table: ErrorTable, address: Address) -> Iterator[None]:
    """Turn the exceptions of a call into a ConnectFailedError."""
    try:
        yield
    except RobotiqConnectionError:
        raise
    except Exception as error:
        known = (reason(error) for kind, reason in table.items() if isinstance(error, kind))
        raise ConnectFailedError(str(address), next(known, str(error) or repr(error))) from error


class _ClientWire:
    """A connection of a pymodbus client."""

    _client: ModbusClient | None = None

    def __init__(self, address: Address) -> None:
        self._address = address

    def close(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            client.close()

    def _lost(self) -> Lost:
        how = " closed the connection" if self._address.is_socket else f": {GONE}"
        return Lost(ConnectionLostError(f"{self._address}{how}"))

    async def _connect(self, make: Callable[..., ModbusClient], on_data: OnData, on_end: OnEnd) -> Send:
        """Connect a client, whose settings ``make`` has."""
        is_made = asyncio.Event()

        def on_connection(is_connected: bool) -> None:
            if is_connected:
                is_made.set()
            else:
                on_end(self._lost())

        self._client = client = make(trace_connect=on_connection, retries=0, reconnect_delay=0)
        client.ctx.data_received = on_data  # type: ignore[method-assign, assignment]
        transport, _ = await client.ctx.call_create()
        client.ctx.transport = transport
        send = self._set_up(transport, on_data, on_end)
        await is_made.wait()  # a serial port is watched from the next turn of the loop on
        return send

    def _set_up(self, transport: AsyncioTransport, on_data: OnData, on_end: OnEnd) -> Send:
        """Tune a connection that was just made; return a function that sends frames on it."""
        raise NotImplementedError


class SocketWire(_ClientWire):
    """A TCP connection."""

    async def open(self, on_data: OnData, on_end: OnEnd, seconds: float) -> Send:
        """Connect to the first address of the host that can be reached.

        Each address but the last gets an equal part of the time: one that does not answer leaves some for the
        others.
        """
        with failing_as(RESOLVING, self._address):
            hosts = await addresses_of(self._address.host, self._address.port)
        *others, last = (partial(AsyncModbusTcpClient, host, port=self._address.port) for host in hosts)
        with failing_as(CONNECTING, self._address):
            for make in others:
                with contextlib.suppress(OSError), Limit(seconds / len(hosts)):
                    return await self._connect(make, on_data, on_end)
            return await self._connect(last, on_data, on_end)

    def _set_up(self, transport: AsyncioTransport, on_data: OnData, on_end: OnEnd) -> Send:  # noqa: ARG002
        """For quick replies, and for noticing a dead peer. Nothing depends on it."""
        # asyncio reads into a buffer of 256 KiB, whose allocation costs several times the handling of a
        # reply. The attribute is undocumented: without it nothing is lost but time.
        with contextlib.suppress(AttributeError):
            transport.max_size = LARGEST_READ
        line = transport.get_extra_info("socket")
        with contextlib.suppress(OSError):
            line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
            for name, value in KEEPALIVE.items():
                if hasattr(socket, name):
                    line.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)
        send: Send = transport.write
        return send

    def close(self) -> None:
        """Close the connection for every process that has it.

        A process that was forked from this one has a copy of the socket: closing ours alone would leave the
        gripper connected, and one that serves a single client would never take us back.
        """
        transport: Any = None if self._client is None else self._client.ctx.transport
        # By a copy of our own: uvloop's sockets cannot be shut down, and not every loop gives one.
        with contextlib.suppress(AttributeError, OSError):
            line = transport.get_extra_info("socket")
            with socket.fromfd(line.fileno(), line.family, line.type) as copy:
                copy.shutdown(socket.SHUT_RDWR)
        super().close()


class SerialWire(_ClientWire):
    """A serial port of this machine."""

    async def open(self, on_data: OnData, on_end: OnEnd, seconds: float) -> Send:  # noqa: ARG002
        """Open the port with the settings of the address."""
        line = self._address.line
        form: dict[str, Any] = {"baudrate": line.baud, "parity": line.parity, "stopbits": line.stopbits}
        with failing_as(OPENING_ERRORS, self._address):
            import serial  # noqa: F401, PLC0415

            make = partial(AsyncModbusSerialClient, self._address.host, **form)
            return await self._connect(make, on_data, on_end)

    def _set_up(self, transport: AsyncioTransport, on_data: OnData, on_end: OnEnd) -> Send:
        port = transport.sync_serial
        hasten(port)

        def send(frame: bytes) -> None:
            try:
                written = os.write(port.fd, frame)
            except BlockingIOError:
                written = 0
            if written < len(frame):
                transport.write(frame[written:])

        def read() -> None:
            try:
                data = os.read(port.fd, LARGEST_READ)
            except (BlockingIOError, InterruptedError):
                return
            except OSError:
                data = b""  # as at the end of the port
            if data:
                on_data(data)
            else:
                on_end(self._lost())

        if hasattr(port, "fd"):
            transport.intern_read_ready = read
            return send
        plain: Send = transport.write
        return plain
