"""The link to one gripper: reads and writes over a connection that pymodbus opens.

pymodbus's asynchronous client opens and closes the connection, TCP or serial. The exchanges on it are made
here, because a client that may retry, reconnect or accept a doubtful reply could send a motion twice:

* One client object per connection, without retries and without reconnecting.
* Every byte that arrives is checked against the one reply expected (frames.py). Anything but the whole right
  answer, in time, ends the exchange *and* the connection: on a link that is out of step the next reply could
  be the answer to this request.
* Transaction ids start at random and continue over connections, so that a reply left over from an earlier
  connection is recognised. They repeat after 65,535 requests.
* Timeouts come from a watchdog that looks once in a while (watchdog.py). ``asyncio.wait_for`` costs more, on
  Python 3.11 swallows a cancellation that lands together with the reply, and takes a blocked loop for silence
  although the reply is waiting in the socket.
* On a serial line a read whose answer is missing or damaged is asked once more; see :meth:`_read_again`.
* Foreign exceptions stop here.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
from collections.abc import Callable, Sequence
from typing import Any, Final

import anyio

from ..runtime.log import Log, log
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from ..values.registers import REGISTER_COUNT, RegisterMap, Registers
from .address import Address
from .connecting import Client, connected_client, disconnect
from .frames import (
    Expected,
    MisfitError,
    check_sum,
    expected_reply,
    read_request,
    registers_in,
    serial_frame,
    show,
    tcp_frame,
    write_request,
)
from .watchdog import Watchdog

# pymodbus logs every failed connection attempt; our exceptions say the same. A level that the application
# sets on its logger stays.
_pymodbus_log = logging.getLogger("pymodbus.logging")
if _pymodbus_log.level == logging.NOTSET:
    _pymodbus_log.setLevel(logging.CRITICAL + 1)

LAST_NUMBER: Final = 0xFFFF
"""Transaction ids are 1 to this."""
SETTLE_S: Final = 0.02
"""From connecting to the first request over TCP: a few round trips of a network in a building."""
SILENCE_S: Final = 0.00175
"""Least silence between two frames on a serial line: 3.5 characters, above 19200 baud this fixed time (Modbus
over Serial Line 2.5.1.1)."""
TIMER_S: Final = 0.0001
"""How early a timer of the loop may fire."""
HUSH_S: Final = 0.02
"""Silence after which the rest of a damaged reply is over: a USB adapter may hold bytes back for 16 ms (the
usual latency timer of FTDI chips)."""
LONGEST_HUSH_S: Final = 0.1
"""Longest wait for that silence. A gripper that was asked one thing does not talk longer."""
REPEAT_S: Final = 0.15
"""Time for a repeated read, so that a write after it still fails within a second."""
USUAL_RESPONSE_S: Final = 0.4
"""A longer response timeout means a slow line: a repeated read then gets that timeout instead of REPEAT_S."""
REPEAT_WARNING_S: Final = 60.0
"""At most one warning about repeated reads in this time."""

NOISE: Final = (MisfitError, ResponseTimeoutError)
"""Errors that a lost or damaged byte can cause."""


class ModbusTransport:
    """A gripper behind Modbus TCP or a serial line (Modbus RTU), of this machine or of a serial server.

    Attributes:
        repeats: number of reads repeated because an answer was missing or damaged.
    """

    def __init__(
        self,
        address: Address,
        registers: RegisterMap,
        *,
        connect_timeout: float,
        response_timeout: float,
        log: Log = log,
    ) -> None:
        """Keep the settings; opens nothing.

        The address is tcp, rtu or rtu+tcp. Timeouts are in seconds; on a serial line a read may be repeated
        after ``response_timeout``.
        """
        self.repeats = 0
        self._log = log
        self._address = address
        self._map = registers
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._rtu = address.is_rtu
        self._keeps_silence = not address.is_socket
        """Whether this link must keep the pauses between frames; a serial server keeps its own."""
        self._client: Client | None = None
        self._line: Any = None
        """The asyncio transport of the connection; pymodbus's class for serial ports is not typed."""
        self._answer: asyncio.Future[bytes] | None = None
        """The reply of the exchange in flight."""
        self._expected: Expected | None = None
        self._received = b""
        """The part of the reply that has arrived."""
        self._failure: RobotiqConnectionError | None = None
        """Why the link broke between two exchanges; the next exchange raises it."""
        self._number = secrets.randbelow(LAST_NUMBER)
        """Transaction id of the last request; starts at random to differ from those of other programs."""
        self._probe = 0
        """Number of registers that the last read for :meth:`_resynchronise` asked for."""
        self._poll = read_request(registers, REGISTER_COUNT)
        self._loop: asyncio.AbstractEventLoop
        self._watchdog: Watchdog
        self._heard = -math.inf
        """When the last bytes arrived, in the loop's time; kept for serial lines only."""
        self._is_hushing = False
        """Whether arriving bytes are dropped as the rest of a damaged reply."""
        self._warned = -math.inf
        """When the last warning about a repeated read was logged, in the loop's time."""

    @property
    def is_open(self) -> bool:
        return self._client is not None

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier request is taken for one to come.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            ProtocolError: the reply is not an answer, or bytes arrive without a request.
            ConnectionLostError: the connection was closed at once.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        await self.close()
        self._loop = loop = asyncio.get_running_loop()
        self._watchdog = Watchdog(loop, self._response_timeout, lambda: self._is_waiting, self._on_timeout)
        self._failure = self._expected = None
        self._received = b""
        try:
            with anyio.fail_after(self._connect_timeout):
                client = await connected_client(
                    self._address, self._on_data, self._on_connection, self._connect_timeout
                )
        except TimeoutError:
            raise ConnectFailedError(
                str(self._address), f"no connection within {self._connect_timeout:g} s"
            ) from None
        self._client, self._line = client, client.ctx.transport
        if self._address.is_socket:
            await self._settle(SETTLE_S)
        await self._resynchronise()

    async def read(self) -> Registers:
        if not self._rtu:
            return registers_in(await self._exchange(self._poll), serial=False)
        try:
            answer = await self._exchange(self._poll, bears_noise=True)
        except NOISE as error:
            answer = await self._read_again(_plain(error))
        return registers_in(answer, serial=True)

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything; on a serial line after the silence between frames.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        if self._keeps_silence:
            await self._pause()
        registers = decide()
        if registers is None:
            return False
        await self.write(registers)
        return True

    async def write(self, registers: Sequence[int]) -> None:
        """Write the eight request registers with one FC16, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        await self._exchange(write_request(self._map, registers))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._drop()

    # -- one exchange ----------------------------------------------------------------------------------

    def _check_connected(self) -> None:
        if self._failure is not None:
            # Between two requests the link broke, or bytes arrived without a request.
            failure, self._failure = self._failure, None
            self._drop()
            raise failure
        if self._client is None:
            raise ConnectionLostError(f"not connected to {self._address}")

    async def _exchange(self, request: bytes, *, by: float = math.inf, bears_noise: bool = False) -> bytes:
        """Send one request and wait for its reply; every other outcome closes the connection.

        Args:
            request: unit and PDU.
            by: when it must be over, in the loop's time, even if the response timeout is longer.
            bears_noise: keep the connection after an error of NOISE and raise it as it is: the caller brings
                the line back in step.
        """
        self._check_connected()
        if self._keeps_silence:
            await self._pause()
        frame = serial_frame(request) if self._rtu else tcp_frame(self._next_number(), request)
        self._expected = expected_reply(frame, serial=self._rtu)
        answer: asyncio.Future[bytes] = self._loop.create_future()
        self._answer = answer
        self._watchdog.watch(by)
        try:
            self._line.write(frame)
            return await answer
        except RobotiqConnectionError as error:
            if bears_noise and isinstance(error, NOISE):
                raise
            self._drop()
            raise _plain(error) from None
        except OSError as error:
            self._drop()
            raise ConnectionLostError(f"{self._address}: {error}") from error
        except BaseException:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._drop()
            if answer.done() and not answer.cancelled():
                answer.exception()  # asyncio reports an exception that was never looked at
            raise
        finally:
            self._answer = self._expected = None
            self._received = b""

    def _next_number(self) -> int:
        """A transaction id. Never 0, which some devices answer to anything."""
        self._number = self._number % LAST_NUMBER + 1
        return self._number

    @property
    def _is_waiting(self) -> bool:
        return self._answer is not None and not self._answer.done()

    def _on_timeout(self) -> None:
        self._fail(
            ResponseTimeoutError(f"{self._address} did not answer within {self._response_timeout:g} s")
        )

    def _fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange in flight with an error; without one, keep the error for the next exchange."""
        if self._answer is not None and not self._answer.done():
            self._answer.set_exception(error)
        elif self._failure is None:
            self._failure = _plain(error)

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            self._watchdog.stop()
            disconnect(client)

    # -- what the connection calls ---------------------------------------------------------------------

    def _on_data(self, data: bytes) -> None:
        """Take what has arrived; the last byte of the reply ends the exchange, or the first wrong one."""
        if self._rtu:
            self._heard = self._loop.time()
            if self._is_hushing:
                return
        frame, self._received = self._received + data, b""
        try:
            if self._expected is None or self._answer is None:
                raise ProtocolError(f"{len(frame)} bytes without a request: {show(frame)}")
            if not self._expected.is_complete(frame):
                self._received = frame
                return
            if self._rtu:
                check_sum(frame)
        except ProtocolError as error:
            self._fail(error)
            return
        self._expected = None  # every byte after this one has no request
        if not self._answer.done():
            self._answer.set_result(frame)

    def _on_connection(self, connected: bool) -> None:
        if not connected:
            self._fail(ConnectionLostError(f"{self._address} closed the connection"))

    # -- in step -----------------------------------------------------------------------------------------

    async def _settle(self, seconds: float) -> None:
        """Wait for bytes left over from an earlier connection before the first request.

        A gateway that keeps its own connection to the gripper may send late replies to its next client. Their
        transaction ids give them away too, but only when a request is already on its way. The reply to that
        request would be left over for the next connection, and so on without end.
        """
        try:
            await asyncio.sleep(seconds)
        except BaseException:
            self._drop()
            raise
        self._check_connected()

    async def _resynchronise(self, by: float = math.inf) -> None:
        """Make sure that no answer to an earlier request is still on its way.

        Serial replies carry no transaction id, and a gateway from TCP to a serial line gives a late reply the
        id of the next request. So this reads one to seven registers instead of eight, a different count each
        time. A late answer has another length and ends the connection. The gripper answers in order, so
        after an answer of the right length nothing older can follow.
        """
        self._probe = self._probe % (REGISTER_COUNT - 1) + 1
        await self._exchange(read_request(self._map, self._probe), by=by)

    async def _read_again(self, why: RobotiqConnectionError) -> bytes:
        """Read once more on a line that lost or damaged a byte, as USB adapters occasionally do.

        The second answer must not be the first one that was only late. So first wait for silence and drop the
        rest of a damaged reply. Then bring the line in step as after opening, with a read of another length:
        if the first answer arrives now, it has the wrong length and ends the connection. Only then read the
        status. A write is never repeated: whether the first one was carried out is unknown.

        Args:
            why: the error of the first read.

        Raises:
            RobotiqConnectionError: ``why``, if there is again no clean answer; the connection is closed.
        """
        is_slow = self._response_timeout > USUAL_RESPONSE_S
        by = self._loop.time() + (self._response_timeout if is_slow else REPEAT_S)
        try:
            await self._hush()
            await self._resynchronise(by)
            answer = await self._exchange(self._poll, by=by)
        except RobotiqConnectionError as error:
            raise why from error
        self.repeats += 1
        if self._heard - self._warned >= REPEAT_WARNING_S:
            self._warned = self._heard
            self._log.warning("a read was repeated: %s (%d times so far)", why, self.repeats)
        return answer

    async def _hush(self) -> None:
        """Drop what arrives until the line is silent.

        Raises:
            ProtocolError: the line does not become silent; the connection is closed.
        """
        loop = self._loop
        began = loop.time()
        self._is_hushing, until = True, began + HUSH_S
        if isinstance(self._failure, ProtocolError):
            self._failure = None  # more of the damaged reply came before this task ran
        try:
            while (left := until - loop.time()) > 0:
                if loop.time() - began > LONGEST_HUSH_S:
                    raise ProtocolError(f"{self._address}: the line does not become silent")
                await asyncio.sleep(left)
                until = max(until, self._heard + HUSH_S)
        except BaseException:
            self._drop()
            raise
        finally:
            self._is_hushing = False

    async def _pause(self) -> None:
        """Keep the silence between frames: what follows sooner may be taken for part of the last frame."""
        left = self._heard + SILENCE_S - self._loop.time()
        if left > TIMER_S:
            await self._settle(left)


def _plain(error: RobotiqConnectionError) -> RobotiqConnectionError:
    """The error as users see it: MisfitError is for this link alone."""
    return ProtocolError(error.message) if isinstance(error, MisfitError) else error
