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
  without harm: on a serial line, and when a gateway or a gripper answers "busy" (:meth:`_read_again`).
  A write is never repeated: whether the first one was carried out is unknown.
* Foreign exceptions stop here.
"""

from __future__ import annotations

import asyncio
import logging
import math
import secrets
from collections import deque
from collections.abc import Awaitable, Callable, Sequence
from contextlib import AbstractContextManager, nullcontext
from typing import Final

from ..runtime.log import Log, log
from ..values.errors import ResponseTimeoutError, RobotiqConnectionError
from ..values.registers import REGISTER_COUNT, RegisterMap, Registers
from .address import Address
from .connection import Bears, Connection, StillOpenError, bears_nothing, plain, shared_connection
from .exchange import SerialExchange, TcpExchange
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
from .transport import Answer

# pymodbus logs every failed connection attempt; our exceptions say the same. A level that the application
# sets on its logger stays.
_pymodbus_log = logging.getLogger("pymodbus.logging")
if _pymodbus_log.level == logging.NOTSET:
    _pymodbus_log.setLevel(logging.CRITICAL + 1)

LAST_NUMBER: Final = 0xFFFF
"""Transaction ids are 1 to this."""
REPEAT_S: Final = 0.15
"""Time for a repeated read, so that a write after it still fails within a second."""
USUAL_RESPONSE_S: Final = 0.4
"""A longer response timeout means a slow line: a repeated read then gets that timeout instead of REPEAT_S."""
SHORT_READS: Final = 3
"""Reads after the short silence, at opening, before a line is trusted with it."""
MOST_UNANSWERED: Final = 3
UNANSWERED_S: Final = 60.0
"""With so many unanswered reads in so many seconds, a line gets the longer silence."""
REPEAT_WARNING_S: Final = 60.0
"""At most one warning about repeated reads in this time."""
_ALONE: Final[AbstractContextManager[None]] = nullcontext()


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
        shares_line: bool = False,
        log: Log = log,
    ) -> None:
        """Keep the settings; opens nothing.

        The address is tcp, rtu or rtu+tcp. Timeouts are in seconds; on a serial line a read may be repeated
        after ``response_timeout``. With ``shares_line``, others of the event loop may use the serial line,
        too, for grippers with other unit ids.
        """
        self.repeats = 0
        self._log = log
        self._address = address
        self._map = registers
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._rtu = address.is_rtu
        self._shares_line = shares_line
        self._connection = Connection(address)
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
        self._unanswered: deque[float] = deque(maxlen=MOST_UNANSWERED)
        """The times of the last reads that were repeated because there was no answer."""
        self._warned = -math.inf
        """The time of the last warning about a repeated read."""

    @property
    def is_open(self) -> bool:
        return self._connection.is_open_for(self)

    @property
    def echoes(self) -> bool:
        """Whether the line was seen to echo what is sent; the echo is dropped."""
        return bool(self._connection.echo.is_on)

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier request is taken for one to come.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            ProtocolError: the reply is not an answer, or bytes arrive without a request.
            ConnectionLostError: the connection was closed at once.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        self._connection.leave(self)
        if self._shares_line:
            self._connection = shared_connection(self._address, self)
        await self._connection.open(self, self._connect_timeout)
        await self._greet()
        if self._connection.keeps_silence and not self._connection.silence.is_long:
            await self._try_short_silence()

    async def read(self) -> Registers:
        try:
            # Every poll comes here, and a connection with one user has no turns: taking them costs 4 % of it.
            with await self._connection.turn(self) if self._shares_line else _ALONE:
                answer = await self._ask(self._poll, bears=self._can_repeat)
        except StillOpenError as borne:
            answer = await self._read_again(plain(borne.error))
        return self._status_in(answer)

    def _status_in(self, answer: bytes) -> Registers:
        registers = registers_in(answer, serial=self._rtu)
        return registers[: self._map.count] + self._rest if self._rest else registers

    @property
    def is_shared(self) -> bool:
        return self._connection.is_shared

    async def stop_or_read(self, decide: Callable[[], Sequence[int] | None]) -> Registers | None:
        """Write what ``decide`` returns when the turn comes, if anything; else read the status.

        After a disturbance of the line it reads, which brings the line in step before a write.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        connection = self._connection
        try:
            with await connection.turn(self):
                await connection.pause(self)
                if not connection.has_noise():
                    connection.check_open(self)
                    if (registers := decide()) is not None:
                        await self._ask(write_request(self._map, registers))
                        return None
                answer = await self._ask(self._poll, bears=self._can_repeat)
        except StillOpenError as borne:
            answer = await self._read_again(plain(borne.error))
        return self._status_in(answer)

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything; on a serial line after the silence between frames.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        with await self._connection.turn(self):
            return await self._send_alone(decide)

    async def _send_alone(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns with function 16, in a turn; return whether there was anything."""
        await self._prepare_write()
        registers = decide()
        if registers is None:
            return False
        await self._ask(write_request(self._map, registers))
        return True

    @property
    def reads_with_writes(self) -> bool:
        return self._writes_with_23

    @property
    def has_read_with_write(self) -> bool:
        return self._has_23

    async def send_and_read(self, decide: Callable[[], Sequence[int] | None]) -> Answer | None:
        """Write what ``decide`` returns, if anything, and read the status, with function 23.

        After a reply that is missing or damaged the write is in doubt, and the status is read on its own. A
        device that refuses the function, or does not answer the first of these, gets function 16 from then
        on. Only what was refused, and so not carried out, is written with it at once: what ``decide`` returns
        then, for a stop may have come since.

        Raises:
            RobotiqConnectionError: no clean answer in time, and no status after it; the transport is closed.
        """
        with await self._connection.turn(self):
            await self._prepare_write()
            registers = decide()
            if registers is None:
                return None
            try:
                reply = await self._ask(
                    write_and_read_request(self._map, registers), bears=self._leaves_doubt
                )
            except StillOpenError as borne:
                error = borne.error
                if not self._has_23 and not isinstance(error, MisfitError):
                    self._writes_with_23 = False
                    self._log.warning("%s is written with function 16: %s", self._address, plain(error))
                is_refused = isinstance(error, RefusedError) and error.is_unknown_function
                if is_refused and not await self._send_alone(decide):
                    return None
            else:
                self._has_23 = True
                return Answer(self._status_in(reply), None)
        if is_refused:
            return Answer(await self.read(), None)
        return Answer(self._status_in(await self._read_again(plain(error))), plain(error))

    async def _prepare_write(self) -> None:
        connection = self._connection
        await connection.pause(self)
        if connection.has_noise():
            await self._bring_in_step(math.inf)  # a write must not meet what is left of a disturbance
            await connection.pause(self)
        connection.check_open(self)

    async def write(self, registers: Sequence[int]) -> None:
        """Write the request registers with one FC16, exactly once; a jaw has three of the eight.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        with await self._connection.turn(self):
            await self._ask(write_request(self._map, registers))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._connection.release(self)

    # -- one exchange ----------------------------------------------------------------------------------

    def _ask(self, request: bytes, *, by: float = math.inf, bears: Bears = bears_nothing) -> Awaitable[bytes]:
        """Send one request and return its reply, in a turn of this gripper.

        Args:
            request: unit and PDU.
            by: when it must be over, in the loop's time, even if the response timeout is longer.
            bears: whether the connection stays open after an error, and StillOpenError is raised.
        """
        exchange = (
            SerialExchange(serial_frame(request), self._connection.echo)
            if self._rtu
            else TcpExchange(tcp_frame(self._next_number(), request))
        )
        return self._connection.exchange(self, exchange, self._response_timeout, by, bears)

    def _can_repeat(self, error: RobotiqConnectionError) -> bool:
        """Whether a read can be asked again after this error."""
        return error.is_passing if isinstance(error, RefusedError) else self._connection.is_noise(error)

    def _leaves_doubt(self, error: RobotiqConnectionError) -> bool:
        """Whether the connection stays usable after this end of a write with function 23."""
        return isinstance(error, RefusedError) or self._connection.is_noise(error)

    def _can_do_without(self, error: RobotiqConnectionError) -> bool:
        """Whether the error may only mean that a jaw does not serve eight registers."""
        return isinstance(error, RefusedError | ResponseTimeoutError) or self._connection.is_noise(error)

    def _next_number(self) -> int:
        """A transaction id. Never 0, which some devices answer to anything."""
        self._number = self._number % LAST_NUMBER + 1
        return self._number

    # -- in step -----------------------------------------------------------------------------------------

    async def _greet(self) -> None:
        """Make the first exchange of a connection, twice if the first one fails harmlessly.

        The tool port of some arms loses the first request of a connection, and ``socat`` with ``waitslave``
        connects only when it sees one. A device with three registers may refuse the read of eight, or not
        answer it.
        """
        asks_for_rest = not self._probe and self._map.count < REGISTER_COUNT
        bears = self._can_do_without if asks_for_rest else self._can_repeat
        try:
            with await self._connection.turn(self):
                await self._resynchronise(bears=bears)
        except StillOpenError as borne:
            why = plain(borne.error)
            try:
                with await self._connection.turn(self):
                    await self._bring_in_step(self._repeat_by())
            except RobotiqConnectionError as again:
                raise why from again
            if asks_for_rest:
                self._log.info("%s did not answer a read of all registers: %s", self._address, why)

    async def _try_short_silence(self) -> None:
        """Read a few times after 3.5 characters of silence; take the longer one if an answer is missing."""
        try:
            for _ in range(SHORT_READS):
                with await self._connection.turn(self):  # one for each: a slow gripper keeps others waiting
                    await self._resynchronise(bears=self._can_repeat)
        except StillOpenError as borne:
            if self._connection.is_noise(borne.error):
                self._keep_long_silence(borne.error)
            with await self._connection.turn(self):
                await self._bring_in_step(math.inf)

    def _note_unanswered(self, why: RobotiqConnectionError) -> None:
        """Take the longer silence if reads stay unanswered that are answered when they are repeated."""
        silence, now = self._connection.silence, self._connection.clock()
        self._unanswered.append(now)
        is_often = len(self._unanswered) == MOST_UNANSWERED and now - self._unanswered[0] < UNANSWERED_S
        if is_often and self._connection.keeps_silence and not silence.is_long:
            self._keep_long_silence(why)

    def _keep_long_silence(self, why: RobotiqConnectionError) -> None:
        silence = self._connection.silence
        silence.is_long = True
        self._log.warning(
            "%s does not answer after a silence of %.1f ms, so it gets 1.75 ms: %s",
            *(self._address, 1000 * silence.short_s, why),
        )

    async def _resynchronise(self, by: float = math.inf, *, bears: Bears = bears_nothing) -> None:
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
        try:
            with await self._connection.turn(self):
                by = self._repeat_by()
                with self._connection.silence.long():  # the shorter one may be why there was no answer
                    await self._bring_in_step(by)
                    answer = await self._ask(self._poll, by=by)
        except RobotiqConnectionError as error:
            raise why from error
        self.repeats += 1
        if isinstance(why, ResponseTimeoutError):
            self._note_unanswered(why)
        if (now := self._connection.clock()) - self._warned >= REPEAT_WARNING_S:
            self._warned = now
            self._log.warning("a read was repeated: %s (%d times so far)", why, self.repeats)
        return answer

    def _repeat_by(self) -> float:
        """The latest end of a repeated read, in the loop's time."""
        is_slow = self._response_timeout > USUAL_RESPONSE_S
        return asyncio.get_running_loop().time() + (self._response_timeout if is_slow else REPEAT_S)

    async def _bring_in_step(self, by: float) -> None:
        await self._connection.hush(self)
        await self._resynchronise(by)
