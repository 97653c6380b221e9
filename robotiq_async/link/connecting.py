"""Opens connections with pymodbus's asynchronous clients."""

from __future__ import annotations

import contextlib
import socket
from collections.abc import Callable
from typing import Any, Final

from pymodbus import FramerType
from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient

from ..runtime.host_names import addresses_of, why_no_socket, why_unreachable
from ..runtime.limit import Limit
from ..values.errors import ConnectFailedError
from .address import Address
from .serial_ports import hasten, why_no_port

Client = AsyncModbusTcpClient | AsyncModbusSerialClient

LARGEST_READ: Final = 4096  # bytes read from the socket at a time; the longest Modbus frame has 260
KEEPALIVE: Final = {"TCP_KEEPIDLE": 5, "TCP_KEEPINTVL": 1, "TCP_KEEPCNT": 5}
"""TCP keepalive: seconds of silence before the first probe, seconds between probes, probes without an answer.
A polling hand is never that silent. But while its program is suspended (a debugger, a sleeping machine),
nothing else shows either end that the other is gone."""


async def connected_client(
    address: Address,
    on_data: Callable[[bytes], None],
    on_connection: Callable[[bool], None],
    seconds: float,
) -> Client:
    """A client that is connected to the first reachable address of the host.

    The caller limits its time to ``seconds``: each address but the last gets an equal part of them, so that
    one that does not answer leaves time for the others. ``on_data`` gets the bytes that arrive, from the
    first one on; ``on_connection`` gets True when the connection is made and False when it is lost.

    Raises:
        ConnectFailedError: refused, unreachable, no such port, or no pyserial.
    """
    # timeout=None: the caller has a timeout of its own, and wait_for becomes a plain await.
    options: dict[str, Any] = {
        "retries": 0,
        "reconnect_delay": 0,
        "timeout": None,
        "trace_connect": on_connection,
    }
    reasons: list[OSError] = []
    hosts = await _hosts(address)
    for host in hosts:
        client, connected = _make(address, host, options), False
        # Replaces pymodbus's receiver before the first byte can arrive: its buffer silently drops what does
        # not fit, and its framer accepts replies that frames.py refuses.
        client.ctx.data_received = on_data  # type: ignore[method-assign, assignment]
        _keep_reasons(client, reasons)
        try:
            with Limit(None if host is hosts[-1] else seconds / len(hosts)):
                connected = await client.connect()
        except Exception as error:
            raise ConnectFailedError(str(address), str(error)) from error
        finally:
            if not connected:
                client.close()
        if connected:
            _set_up(client, address)
            return client
    last = reasons[-1] if reasons else None
    why = why_no_socket() or why_unreachable(last) if address.is_socket else why_no_port(last)
    raise ConnectFailedError(str(address), why) from last


def disconnect(client: Client) -> None:
    """Close the connection for every process that has it.

    A process that was forked from this one has a copy of the socket: closing ours alone would leave the
    gripper connected, and one that serves a single client would never take us back.
    """
    transport: Any = client.ctx.transport
    line: Any = None if transport is None else transport.get_extra_info("socket")
    # By a copy of our own: uvloop's sockets cannot be shut down, and not every loop gives one.
    with (
        contextlib.suppress(AttributeError, OSError),
        socket.fromfd(line.fileno(), line.family, line.type) as copy,
    ):
        copy.shutdown(socket.SHUT_RDWR)
    client.close()


async def _hosts(address: Address) -> list[str]:
    if not address.is_socket:
        return [address.host]
    try:
        return await addresses_of(address.host, address.port)
    except Exception as error:  # also RuntimeError, if no thread can be started
        why = f"the name cannot be resolved: {getattr(error, 'strerror', None) or error}"
        raise ConnectFailedError(str(address), why) from error


def _make(address: Address, host: str, options: dict[str, Any]) -> Client:
    client: Client
    if address.is_socket:
        framer = FramerType.RTU if address.is_rtu else FramerType.SOCKET
        client = AsyncModbusTcpClient(host, port=address.port, framer=framer, **options)
    else:
        try:
            import serial  # noqa: F401, PLC0415
        except ImportError:
            from ..runtime.extras import install  # noqa: PLC0415  # nothing else needs it

            raise ConnectFailedError(
                str(address), f"serial ports need pyserial: {install('serial')}"
            ) from None
        line = address.line
        form: dict[str, Any] = {
            "baudrate": line.baud,
            "bytesize": 8,
            "parity": line.parity,
            "stopbits": line.stopbits,
        }
        client = AsyncModbusSerialClient(host, framer=FramerType.RTU, **form, **options)
    return client


def _set_up(client: Client, address: Address) -> None:
    """Tune the connection for quick replies and for noticing a dead peer. Nothing depends on it."""
    transport: Any = client.ctx.transport
    if not address.is_socket:
        hasten(transport.sync_serial)
        return
    # asyncio reads into a buffer of 256 KiB, whose allocation costs several times the handling of a reply.
    # The attribute is undocumented: without it nothing is lost but time.
    with contextlib.suppress(AttributeError):
        transport.max_size = LARGEST_READ
    line = transport.get_extra_info("socket")
    with contextlib.suppress(OSError):
        line.setsockopt(socket.SOL_SOCKET, socket.SO_KEEPALIVE, 1)
        for name, value in KEEPALIVE.items():
            if hasattr(socket, name):
                line.setsockopt(socket.IPPROTO_TCP, getattr(socket, name), value)


def _keep_reasons(client: Client, reasons: list[OSError]) -> None:
    """Collect the errors of connecting, which pymodbus only logs."""
    create = client.ctx.call_create

    async def created() -> object:
        try:
            return await create()
        except OSError as error:
            reasons.append(error)
            raise

    client.ctx.call_create = created
