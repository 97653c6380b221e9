"""The link to one gripper: reads and writes over pymodbus.

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
* On a serial line a read whose answer is missing or damaged is asked once more; see :meth:`_read_again`.
* Foreign exceptions stop here.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
from collections.abc import Callable, Sequence
from typing import Final

import anyio
from pymodbus.exceptions import ModbusException
from pymodbus.framer import FramerRTU
from pymodbus.pdu import ModbusPDU

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
from .connecting import Client, connected_client
from .frames import Expected, MisfitError, expected_reply, show
from .pdus import ReadRequest, WriteRequest
from .watchdog import Watchdog

# pymodbus logs its send and receive history at ERROR on every timeout; what matters of it is said in our
# exceptions. Whoever sets a level on its logger gets what they ask for.
_pymodbus_log = logging.getLogger("pymodbus.logging")
if _pymodbus_log.level == logging.NOTSET:
    _pymodbus_log.setLevel(logging.CRITICAL + 1)

LAST_NUMBER: Final = 0xFFFF
"""Transaction ids are 1 to this."""
SETTLE_S: Final = 0.02
"""From connecting to the first request over TCP: a few round trips of a network in a building."""
SILENCE_S: Final = 0.00175
"""Between two frames on a serial line, at least: 3.5 characters, above 19200 baud so much (Modbus over Serial
Line 2.5.1.1)."""
TIMER_S: Final = 0.0001
"""So much before its time a timer may come."""
HUSH_S: Final = 0.02
"""Silence after which the rest of a damaged reply does not come any more: a USB adapter may keep bytes for
16 ms (the usual latency timer of FTDI's)."""
LONGEST_HUSH_S: Final = 0.1
"""For which silence is waited for; who talks on is no gripper that was asked once."""
REPEAT_S: Final = 0.15
"""For a read that is asked again, so that a write after it still fails within a second."""
USUAL_RESPONSE_S: Final = 0.4
"""With a longer response timeout a line is slow, and a read that is asked again has that time once more."""
REPEAT_WARNING_S: Final = 60.0
"""At most one line in the log about reads asked again in this time."""


class _ExchangeEndedError(Exception):
    """Carries the reason through pymodbus, which would take a TimeoutError for its own."""

    def __init__(self, reason: RobotiqConnectionError, *, may_be_noise: bool) -> None:
        self.reason = reason
        self.may_be_noise = may_be_noise
        """Whether a byte that was lost or damaged can be the reason."""
        super().__init__(str(reason))


class ModbusTransport:
    """A gripper behind Modbus TCP or a serial line (Modbus RTU), of this machine or of a serial server.

    Attributes:
        repeats: reads that were asked once more, because the answer was missing or damaged.
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
        """Keep what is needed to connect; opens nothing.

        Args:
            address: a tcp, rtu or rtu+tcp address.
            registers: where the blocks lie, and the device id.
            connect_timeout: seconds for connecting.
            response_timeout: seconds for one answer; on a serial line a read may be asked again after that.
            log: of the hand.
        """
        self.repeats = 0
        self._log = log
        self._address = address
        self._map = registers
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._rtu = address.is_rtu
        self._keeps_silence = not address.is_socket
        """Whether the pauses between frames are ours to keep, and not a serial server's."""
        self._client: Client | None = None
        self._expected: Expected | None = None
        self._failure: RobotiqConnectionError | None = None
        self._number = secrets.randbelow(LAST_NUMBER)
        """The transaction id of the last request; another program's are others, most likely."""
        self._their_number = b""
        """pymodbus's own transaction id of the request in flight."""
        self._probe = 0
        self._poll = ReadRequest(registers)
        self._loop: asyncio.AbstractEventLoop
        self._watchdog: Watchdog
        self._heard = -math.inf
        """When bytes came last, in the loop's time; kept on a serial line."""
        self._is_hushing = False
        """Whether what comes is dropped: it is the rest of a damaged reply."""
        self._warned = -math.inf

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
        self._loop = loop = asyncio.get_running_loop()
        self._watchdog = Watchdog(loop, self._response_timeout, lambda: self._is_waiting, self._too_long)
        self._failure = self._expected = None
        try:
            with anyio.fail_after(self._connect_timeout):
                self._client = await connected_client(self._address, self._trace_packet, self._trace_connect)
        except TimeoutError:
            raise ConnectFailedError(
                str(self._address), f"no connection within {self._connect_timeout:g} s"
            ) from None
        if self._address.is_socket:
            await self._settle(SETTLE_S)
        await self._resynchronise()

    async def read(self) -> Registers:
        """The eight status registers.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        if not self._rtu:
            return tuple((await self._exchange(self._poll)).registers)
        try:
            answer = await self._exchange(self._poll, bears_noise=True)
        except _ExchangeEndedError as ended:
            answer = await self._read_again(ended.reason)
        return tuple(answer.registers)

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
        await self._exchange(WriteRequest(self._map, registers))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._drop()

    # -- one exchange ----------------------------------------------------------------------------------

    def _connected(self) -> Client:
        if self._failure is not None:
            # The link broke, or something arrived that nobody had asked for, between two requests.
            failure, self._failure = self._failure, None
            self._drop()
            raise failure
        if self._client is None:
            raise ConnectionLostError(f"not connected to {self._address}")
        return self._client

    async def _exchange(
        self,
        request: ModbusPDU,
        *,
        by: float = math.inf,
        bears_noise: bool = False,
    ) -> ModbusPDU:
        """Send one request and wait for its answer; on anything else the connection is given up.

        Args:
            request: what to send.
            by: when it must be over, in the loop's time, even if the response timeout is not.
            bears_noise: after what may be noise the connection is kept, and _ExchangeEndedError raised: the
                caller gets the line back in step.
        """
        client = self._connected()
        if self._keeps_silence:
            await self._pause()
        self._watchdog.watch(by)
        try:
            response: ModbusPDU = await client.execute(False, request)
        except _ExchangeEndedError as ended:
            if bears_noise and ended.may_be_noise:
                raise
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

    @property
    def _is_waiting(self) -> bool:
        """Whether an exchange is under way."""
        client = self._client
        return client is not None and self._expected is not None and not client.ctx.response_future.done()

    def _too_long(self) -> None:
        waited = f"{self._response_timeout:g} s"
        late = ResponseTimeoutError(f"{self._address} did not answer within {waited}")
        self._fail(late, may_be_noise=True)

    def _fail(self, error: RobotiqConnectionError, *, may_be_noise: bool = False) -> None:
        """End the exchange in flight with an error; without one, keep the error for the next."""
        if self._client is not None and self._is_waiting:
            ended = _ExchangeEndedError(error, may_be_noise=may_be_noise)
            self._client.ctx.response_future.set_exception(ended)
        elif self._failure is None:
            self._failure = error

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            self._watchdog.stop()
            client.close()

    # -- what pymodbus calls ---------------------------------------------------------------------------

    def _trace_packet(self, sending: bool, data: bytes) -> bytes:
        """Every frame that is sent, and the bytes received so far for one: returns what goes on from here."""
        if sending:
            frame = data if self._rtu else self._numbered(data)
            self._expected = expected_reply(frame, serial=self._rtu)
            return frame
        if self._rtu:
            self._heard = self._loop.time()
            if self._is_hushing:
                return b""
        try:
            if self._expected is None:
                raise ProtocolError(f"{len(data)} bytes that nobody asked for: {show(data)}")
            complete = self._expected.is_complete(data)
            if complete and self._rtu:
                _check_sum(data)
        except ProtocolError as error:
            self._fail(ProtocolError(error.message), may_be_noise=isinstance(error, MisfitError))
            return b""
        if not complete:
            return b""
        return data if self._rtu else self._their_number + data[len(self._their_number) :]

    def _numbered(self, frame: bytes) -> bytes:
        """The frame with a transaction id of ours; 0 is none, some devices answer it to anything."""
        self._number = self._number % LAST_NUMBER + 1
        self._their_number, rest = frame[:2], frame[2:]
        return self._number.to_bytes(2, "big") + rest

    def _trace_connect(self, connected: bool) -> None:
        if not connected:
            self._fail(ConnectionLostError(f"{self._address} closed the connection"))

    # -- in step -----------------------------------------------------------------------------------------

    async def _settle(self, seconds: float) -> None:
        """Give what is left over from an earlier connection time to show itself before anything is asked.

        A gateway that keeps its own connection to the gripper may send late replies to whoever connects
        next. Their numbers tell as well; but by then a request of ours is on its way, whose reply would be
        left over for the next connection, and so on without end.
        """
        try:
            await asyncio.sleep(seconds)
        except BaseException:
            self._drop()
            raise
        self._connected()

    async def _resynchronise(self, by: float = math.inf) -> None:
        """Make sure that no answer to an earlier request is still on its way.

        Serial replies carry no number, and a gateway from TCP to a serial line gives a late one the number
        of what it is asked next. So after opening, one to seven registers are read instead of eight, a
        different count each time: a late answer has another length and is found out, and the gripper
        answers in order, so that once the right length is back nothing older can follow.
        """
        self._probe = self._probe % (REGISTER_COUNT - 1) + 1
        await self._exchange(ReadRequest(self._map, self._probe), by=by)

    async def _read_again(self, why: RobotiqConnectionError) -> ModbusPDU:
        """Read once more on a line that has lost or damaged a byte, as USB adapters do now and then.

        The second answer cannot be the first one that was only late. First the line must fall silent: what
        is left of a damaged reply is dropped. Then the line is brought in step as when it is opened, by a
        read of another length: if the first answer comes now, it has the wrong length, and the link is given
        up; if the right length comes, the gripper, which answers in order, has nothing older to send. Only
        then the status is asked for. All of that must be quick. A write is never sent again:
        whether the first was carried out cannot be known.

        Args:
            why: the first answer did not come.

        Raises:
            RobotiqConnectionError: again no clean answer; it is the first reason. The connection is closed.
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
            self._log.warning("a read was asked again: %s (%d times so far)", why, self.repeats)
        return answer

    async def _hush(self) -> None:
        """Wait until nothing comes any more; that is dropped.

        Raises:
            ProtocolError: something comes all the time; the connection is closed.
        """
        loop = self._loop
        began = loop.time()
        self._is_hushing, until = True, began + HUSH_S
        if isinstance(self._failure, ProtocolError):
            self._failure = None  # more of the same came before this task had its turn
        try:
            while (left := until - loop.time()) > 0:
                if loop.time() - began > LONGEST_HUSH_S:
                    raise ProtocolError(f"{self._address} does not fall silent")
                await asyncio.sleep(left)
                until = max(until, self._heard + HUSH_S)
        except BaseException:
            self._drop()
            raise
        finally:
            self._is_hushing = False

    async def _pause(self) -> None:
        """Keep the silence that ends a frame: what follows too soon may be taken for a part of it."""
        left = self._heard + SILENCE_S - self._loop.time()
        if left > TIMER_S:
            await self._settle(left)


def _check_sum(frame: bytes) -> None:
    """Refuse a frame of a serial line that was damaged; pymodbus would wait for another.

    Raises:
        MisfitError: its checksum does not fit.
    """
    if not FramerRTU.check_CRC(frame[:-2], int.from_bytes(frame[-2:], "big")):
        raise MisfitError(f"a wrong checksum: {show(frame)}")
