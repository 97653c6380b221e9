"""The link to one gripper: reads and writes over a connection that pymodbus opens.

pymodbus's asynchronous client opens and closes the connection, TCP or serial. The exchanges on it are made
here, because a client that may retry, reconnect or accept a doubtful reply could send a motion twice:

* One client object per connection, without retries and without reconnecting.
* Every byte that arrives is checked against the one reply expected (exchange.py, frames.py). Anything but the
  whole right answer, in time, ends the exchange *and* the connection: on a link that is out of step the next
  reply could be the answer to this request.
* Transaction ids start at random and continue over connections, so that a reply left over from an earlier
  connection is recognised. They repeat after 65,535 requests.
* Timeouts come from a watchdog that looks once in a while (watchdog.py). ``asyncio.wait_for`` costs more, on
  Python 3.11 swallows a cancellation that lands together with the reply, and takes a blocked loop for silence
  although the reply is waiting in the socket.
* A read, the first one of a connection too, is asked once more where its answer can be missing or damaged
  without harm: on a serial line, and when a gateway or a gripper says that it is busy (:meth:`_read_again`).
  A write is never repeated: whether the first one was carried out is unknown.
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

from ..runtime.clock import clock_of
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
from .exchange import Exchange, strays
from .frames import (
    MisfitError,
    RefusedError,
    read_request,
    registers_in,
    serial_frame,
    tcp_frame,
    write_and_read_request,
    write_request,
)
from .silence import Silence
from .transport import Answer
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
HUSH_S: Final = 0.02
"""Silence after which the rest of a damaged reply is over: a USB adapter may hold bytes back for 16 ms (the
usual latency timer of FTDI chips)."""
LONGEST_HUSH_S: Final = 0.1
"""Longest wait for that silence. A gripper that was asked one thing does not talk longer."""
REPEAT_S: Final = 0.15
"""Time for a repeated read, so that a write after it still fails within a second."""
USUAL_RESPONSE_S: Final = 0.4
"""A longer response timeout means a slow line: a repeated read then gets that timeout instead of REPEAT_S."""
SHORT_READS: Final = 3
"""Reads after the short silence, at opening, before a line is trusted with it."""
REPEAT_WARNING_S: Final = 60.0
"""At most one warning about repeated reads in this time."""

NOISE: Final = (MisfitError, ResponseTimeoutError)
"""Errors that a lost or damaged byte can cause."""


Bears = Callable[[RobotiqConnectionError], bool]


class _StillOpenError(Exception):
    """An error that left the connection open, in ``error``: the caller brings the line back in step."""

    def __init__(self, error: RobotiqConnectionError) -> None:
        super().__init__(str(error))
        self.error = error


def _nothing(_: RobotiqConnectionError) -> bool:
    return False


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
        self._exchange: Exchange | None = None
        """The exchange in flight."""
        self._failure: RobotiqConnectionError | None = None
        """An error of the link between two exchanges; the next exchange raises it."""
        self._number = secrets.randbelow(LAST_NUMBER)
        """Transaction id of the last request; starts at random to differ from those of other programs."""
        self._poll = read_request(registers, registers.count)
        self._writes_with_23 = registers.write_function == 23
        self._has_23 = False
        """Whether function 23 was answered once."""
        self._probe = 0
        """Number of registers that the last read for :meth:`_resynchronise` asked for."""
        self._rest: Registers = ()
        """The registers after those that a poll reads, as they were at opening, if any was not 0."""
        self._loop: asyncio.AbstractEventLoop
        self._clock: Callable[[], float]
        self._watchdog: Watchdog
        self._silence = Silence(address.line.character_s)
        self._is_echoed: bool | None = False
        """Whether the line echoes what is sent; None until the first exchange of a connection tells."""
        self._is_hushing = False
        """Whether arriving bytes are dropped as the rest of a damaged reply."""
        self._warned = -math.inf
        """When the last warning about a repeated read was logged."""

    @property
    def is_open(self) -> bool:
        return self._client is not None

    @property
    def echoes(self) -> bool:
        """Whether the line was seen to echo what is sent; the echo is dropped."""
        return bool(self._is_echoed)

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
        self._clock = clock_of(loop)
        self._watchdog = Watchdog(loop, self._response_timeout, lambda: self._is_waiting, self._on_timeout)
        self._failure, self._is_echoed = None, None if self._rtu else False
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
        self._silence.heard = self._clock()  # whatever the line carried for the last connection
        await self._greet()
        if self._keeps_silence and not self._silence.is_long:
            await self._try_short_silence()

    async def read(self) -> Registers:
        try:
            answer = await self._ask(self._poll, bears=self._can_repeat)
        except _StillOpenError as borne:
            answer = await self._read_again(_plain(borne.error))
        return self._status_in(answer)

    def _status_in(self, answer: bytes) -> Registers:
        registers = registers_in(answer, serial=self._rtu)
        return registers[: self._map.count] + self._rest if self._rest else registers

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything; on a serial line after the silence between frames.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        await self._prepare_write()
        registers = decide()
        if registers is None:
            return False
        await self.write(registers)
        return True

    @property
    def reads_with_writes(self) -> bool:
        return self._writes_with_23

    async def send_and_read(self, decide: Callable[[], Sequence[int] | None]) -> Answer | None:
        """Write what ``decide`` returns, if anything, and read the status, with function 23.

        After a reply that is missing or damaged the write is in doubt, and the status is read on its own. A
        device that refuses the function, or does not answer the first of these, gets function 16 from then
        on. The write is repeated with it only if it was refused, and so not carried out.

        Raises:
            RobotiqConnectionError: no clean answer in time, and no status after it; the transport is closed.
        """
        await self._prepare_write()
        registers = decide()
        if registers is None:
            return None
        try:
            reply = await self._ask(write_and_read_request(self._map, registers), bears=self._leaves_doubt)
        except _StillOpenError as borne:
            error = borne.error
            if not self._has_23 and not isinstance(error, MisfitError):
                self._writes_with_23 = False
                self._log.warning("%s is written with function 16: %s", self._address, _plain(error))
            if isinstance(error, RefusedError) and error.is_unknown_function:
                await self.write(registers)
                return Answer(await self.read(), None)
            return Answer(self._status_in(await self._read_again(_plain(error))), _plain(error))
        self._has_23 = True
        return Answer(self._status_in(reply), None)

    async def _prepare_write(self) -> None:
        await self._pause()
        if self._failure is not None and self._can_repeat(self._failure):
            await self._bring_in_step(math.inf)  # a write must not meet what is left of a disturbance
            await self._pause()
        self._check_connected()

    async def write(self, registers: Sequence[int]) -> None:
        """Write the request registers with one FC16, exactly once; a jaw has three of the eight.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        await self._ask(write_request(self._map, registers))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._drop()

    # -- one exchange ----------------------------------------------------------------------------------

    def _check_connected(self) -> None:
        if self._failure is not None:
            # Between two requests the link broke, or bytes arrived without a request.
            failure, self._failure = self._failure, None
            self._drop()
            raise _plain(failure)
        if self._client is None:
            raise ConnectionLostError(f"not connected to {self._address}")

    async def _ask(self, request: bytes, *, by: float = math.inf, bears: Bears = _nothing) -> bytes:
        """Send one request and wait for its reply; every other outcome closes the connection.

        Args:
            request: unit and PDU.
            by: when it must be over, in the loop's time, even if the response timeout is longer.
            bears: tells the errors after which the connection stays open, and _StillOpenError is raised.
        """
        await self._pause()
        failure = self._failure
        if failure is not None and bears(failure):
            self._failure = None
            raise _StillOpenError(failure)
        self._check_connected()
        frame = serial_frame(request) if self._rtu else tcp_frame(self._next_number(), request)
        exchange = Exchange(frame, self._loop, serial=self._rtu, is_echoed=self._is_echoed)
        self._exchange = exchange
        self._watchdog.watch(by)
        try:
            self._line.write(frame)
            answer = await exchange.answer
        except RobotiqConnectionError as error:
            if bears(error):
                raise _StillOpenError(error) from None
            self._drop()
            raise _plain(error) from None
        except OSError as error:
            self._drop()
            raise ConnectionLostError(f"{self._address}: {error}") from error
        except BaseException:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._drop()
            if exchange.answer.done() and not exchange.answer.cancelled():
                exchange.answer.exception()  # asyncio reports an exception that was never looked at
            raise
        finally:
            self._exchange = None
            self._is_echoed = self._is_echoed or exchange.is_echoed
        self._is_echoed = bool(self._is_echoed)
        return answer

    def _is_noise(self, error: RobotiqConnectionError) -> bool:
        """Whether a lost or damaged byte of a serial line can be the cause."""
        return self._rtu and isinstance(error, NOISE)

    def _can_repeat(self, error: RobotiqConnectionError) -> bool:
        """Whether a read can be asked again after this error."""
        return error.is_passing if isinstance(error, RefusedError) else self._is_noise(error)

    def _leaves_doubt(self, error: RobotiqConnectionError) -> bool:
        """Whether the connection can go on after this end of a write with function 23."""
        return isinstance(error, RefusedError) or self._is_noise(error)

    def _can_do_without(self, error: RobotiqConnectionError) -> bool:
        """Whether the error may only mean that a jaw does not serve eight registers."""
        return isinstance(error, RefusedError | ResponseTimeoutError) or self._is_noise(error)

    def _next_number(self) -> int:
        """A transaction id. Never 0, which some devices answer to anything."""
        self._number = self._number % LAST_NUMBER + 1
        return self._number

    @property
    def _is_waiting(self) -> bool:
        return self._exchange is not None and self._exchange.is_waiting

    def _on_timeout(self) -> None:
        self._fail(
            ResponseTimeoutError(f"{self._address} did not answer within {self._response_timeout:g} s")
        )

    def _fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange in flight with an error; without one, keep the error for the next exchange."""
        if self._exchange is not None and self._exchange.is_waiting:
            self._exchange.fail(error)
        elif self._failure is None or not self._can_repeat(error):
            self._failure = error

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            self._watchdog.stop()
            disconnect(client)

    # -- what the connection calls ---------------------------------------------------------------------

    def _on_data(self, data: bytes) -> None:
        """Take what has arrived; the last byte of the reply ends the exchange, or the first wrong one."""
        if self._rtu:
            self._silence.heard = self._clock()
            if self._is_hushing:
                return
        if self._exchange is None or not self._exchange.is_waiting:
            self._fail(strays(data))
        elif (error := self._exchange.take(data)) is not None:
            self._fail(error)

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

    async def _greet(self) -> None:
        """Make the first exchange of a connection, twice if the first one fails harmlessly.

        The tool port of some arms loses the first request of a connection, and ``socat`` with ``waitslave``
        connects only when it sees one. A device with three registers may refuse the read of eight, or not
        answer it.
        """
        asks_for_rest = not self._probe and self._map.count < REGISTER_COUNT
        bears = self._can_do_without if asks_for_rest else self._can_repeat
        try:
            await self._resynchronise(bears=bears)
        except _StillOpenError as borne:
            why = _plain(borne.error)
            try:
                await self._bring_in_step(self._repeat_by())
            except RobotiqConnectionError as again:
                raise why from again
            if asks_for_rest:
                self._log.info("%s did not answer a read of all registers: %s", self._address, why)

    async def _try_short_silence(self) -> None:
        """Read a few times after 3.5 characters of silence; take the longer one if an answer is missing."""
        try:
            for _ in range(SHORT_READS):
                await self._resynchronise(bears=self._can_repeat)
        except _StillOpenError as borne:
            if self._is_noise(borne.error):
                self._silence.is_long = True
                self._log.warning(
                    "%s does not answer after a silence of %.1f ms, so it gets 1.75 ms: %s",
                    *(self._address, 1000 * self._silence.short_s, borne.error),
                )
            await self._bring_in_step(math.inf)

    async def _resynchronise(self, by: float = math.inf, *, bears: Bears = _nothing) -> None:
        """Make sure that no answer to an earlier request is still on its way.

        Serial replies carry no transaction id, and a gateway from TCP to a serial line gives a late reply the
        id of the next request. So this reads fewer registers than a poll, another number each time. A late
        answer to a poll has another length. The gripper answers in order, so after an answer of the right
        length nothing older than the last of these reads can follow, and so no status.

        The first one of all asks a jaw for eight registers, which show a wrong model.
        """
        count = self._map.count
        if not self._probe and count < REGISTER_COUNT:
            self._probe = REGISTER_COUNT
            answer = await self._ask(read_request(self._map, REGISTER_COUNT), by=by, bears=bears)
            rest = registers_in(answer, serial=self._rtu)[count:]
            self._rest = rest if any(rest) else ()
            return
        self._probe = self._probe % (count - 1) + 1
        await self._ask(read_request(self._map, self._probe), by=by, bears=bears)

    async def _read_again(self, why: RobotiqConnectionError) -> bytes:
        """Read once more on a line that lost or damaged a byte, as USB adapters occasionally do.

        The second answer must not be the first one that was only late. So first wait for silence and drop the
        rest of a damaged reply. Then bring the line in step as after opening, with a read of another length:
        if the first answer arrives now, it has the wrong length and ends the connection. Only then read the
        status.

        Args:
            why: the error of the first read.

        Raises:
            RobotiqConnectionError: ``why``, if there is again no clean answer; the connection is closed.
        """
        by = self._repeat_by()
        try:
            await self._bring_in_step(by)
            answer = await self._ask(self._poll, by=by)
        except RobotiqConnectionError as error:
            raise why from error
        self.repeats += 1
        if (now := self._clock()) - self._warned >= REPEAT_WARNING_S:
            self._warned = now
            self._log.warning("a read was repeated: %s (%d times so far)", why, self.repeats)
        return answer

    def _repeat_by(self) -> float:
        """When a repeated read must be over, in the loop's time."""
        is_slow = self._response_timeout > USUAL_RESPONSE_S
        return self._loop.time() + (self._response_timeout if is_slow else REPEAT_S)

    async def _bring_in_step(self, by: float) -> None:
        await self._hush()
        await self._resynchronise(by)

    async def _hush(self) -> None:
        """Drop what arrives until the line is silent.

        Raises:
            ProtocolError: the line does not become silent; the connection is closed.
        """
        began = self._clock()
        self._is_hushing, until = True, began + HUSH_S
        if isinstance(self._failure, ProtocolError):
            self._failure = None  # more of the damaged reply came before this task ran
        try:
            while (left := until - self._clock()) > 0:
                if self._clock() - began > LONGEST_HUSH_S:
                    raise ProtocolError(f"{self._address}: the line does not become silent")
                await asyncio.sleep(left)
                until = max(until, self._silence.heard + HUSH_S)
        except BaseException:
            self._drop()
            raise
        finally:
            self._is_hushing = False

    async def _pause(self) -> None:
        """Keep the silence between frames: what follows sooner may be taken for part of the last frame."""
        if not self._keeps_silence or self._client is None:
            return
        try:
            await self._silence.keep(self._clock)
        except BaseException:
            self._drop()
            raise


def _plain(error: RobotiqConnectionError) -> RobotiqConnectionError:
    """The error as users see it: some kinds are for this link alone."""
    return ProtocolError(error.message) if isinstance(error, MisfitError | RefusedError) else error
