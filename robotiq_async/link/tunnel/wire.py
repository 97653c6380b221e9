"""A tunnel as a wire.

Each frame is one call of :meth:`Tunnel.exchange`, in a task that makes all calls. A call whose answer is no
longer waited for is cancelled when the next request leaves, and that request waits for its end. So a tunnel
never carries two requests at a time, and a request that it still keeps has left it before the next one does.
A late reply is dropped, and a write without an answer stays in doubt until a status decides (dialogue.py).
"""

from __future__ import annotations

import asyncio
from typing import Final

import anyio

from ...runtime.concurrency import LateError
from ...runtime.host_names import why_unreachable
from ...runtime.logger import Log, log
from ...values.errors import ConnectionLostError, ProtocolError, ResponseTimeoutError
from ..address import Address
from ..outcome import Lost, Noise, Outcome, Silent
from ..wires import ErrorTable, OnData, OnEnd, Send, failing_as
from .protocol import Tunnel
from .worker import TunnelCall, Worker

TUNNEL_CLOSE_S: Final = 0.5
"""Time for a tunnel to close."""
ENDED_S: Final = TUNNEL_CLOSE_S + 0.1
"""For how long its close is waited for: its last call, which is cancelled, comes before."""
TUNNEL_ERRORS: Final[ErrorTable] = {
    LateError: lambda error: f"no connection {error}",
    TimeoutError: lambda error: str(error) or "no connection in time",
    OSError: why_unreachable,
    Exception: repr,
}


class TunnelWire:
    """A tunnel as a wire, over all its connections."""

    def __init__(self, tunnel: Tunnel, address: Address, log: Log = log) -> None:
        """Keep the tunnel; opens nothing."""
        self._tunnel: Final = tunnel
        self._address: Final = address
        self._log: Final = log
        self._worker: Final = Worker("robotiq_async tunnel")
        self._loop: asyncio.AbstractEventLoop | None = None
        """The loop in which it was opened; None once it was closed."""
        self._call: TunnelCall | None = None
        """The exchange that was begun last, until it has ended."""
        self._on_data: OnData
        self._on_end: OnEnd

    async def open(self, on_data: OnData, on_end: OnEnd, seconds: float) -> Send:
        """Open the tunnel, after its last call for an earlier connection."""
        self._on_data, self._on_end = on_data, on_end
        self._loop = asyncio.get_running_loop()
        with failing_as(TUNNEL_ERRORS, self._address):
            await self._worker.call(self._tunnel.open, seconds)
        return self._send

    def _send(self, pdu: bytes) -> None:
        self._give_up()
        self._call = call = self._worker.begin(lambda: self._tunnel.exchange(pdu), lambda: self._take(call))

    def _take(self, call: TunnelCall) -> None:
        """Pass on the result of a call, if the line still waits for it."""
        if call is not self._call:
            return
        self._call = None
        if call.error is not None:
            self._on_end(self._outcome(call.error))
        elif isinstance(call.result, bytes | bytearray):
            self._on_data(bytes(call.result))
        else:
            self._on_end(self._lost(f"exchange() must return bytes, got {type(call.result).__name__}"))

    def _outcome(self, error: BaseException) -> Outcome:
        match error:
            case ProtocolError():
                return Noise(error)
            case ConnectionLostError():
                return Lost(error)
            case TimeoutError(errno=None):  # with a number it is a socket's, which has ended
                return Silent(ResponseTimeoutError(f"{self._address}: {str(error) or 'no answer'}"))
        return self._lost(repr(error))

    def _lost(self, why: str) -> Lost:
        return Lost(ConnectionLostError(f"{self._address}: {why}"))

    def _give_up(self) -> None:
        call, self._call = self._call, None
        if call is not None:
            call.give_up()

    def close(self) -> None:
        """Close the tunnel after its present call, which is cancelled; only the next open() waits."""
        loop, self._loop = self._loop, None
        if loop is None or loop.is_closed():  # its calls have ended with the loop
            self._call = None
            return
        self._give_up()
        self._worker.end(self._close)

    async def _close(self) -> None:
        try:
            async with asyncio.timeout(TUNNEL_CLOSE_S):
                await self._tunnel.close()
        except Exception as error:  # noqa: BLE001  # nothing is left to do
            self._log.warning("the tunnel did not close: %r", error)

    async def closed(self) -> None:
        """Wait until the tunnel has closed, for a limited time."""
        with anyio.CancelScope(shield=True):
            if not await self._worker.ended(ENDED_S):
                self._log.warning("the tunnel is given up: its last call did not return")
