"""The link to a jaw behind Robotiq's URCap on a UR: the text port 63352, one variable a question.

To the rest of the library it is a link like the others: registers in, registers out (lines.py has the
translation). What the port makes different is decided here:

* A status takes a question for each variable, so it is not of one moment. Each read asks for PRE first, then
  for OBJ and POS, and for one of the slow variables in turn (GTO, STA, FLT, ACT). The echo of a request comes
  before the object status: an old OBJ beside a new echo would look like an arrival.
* Echo, activation and go belong together: a go that is newer than the echo beside it would look like the
  request of another client. So everything is read when a part of it changes, and after a write that changes
  activation or go until they show it; then PRE lies between two equal answers to ACT and GTO, and was true
  together with them. A new PRE that this link has written is no surprise: a stream of positions goes on with
  the short read.
* Answers carry no number. There is one question at a time, and after whatever is not the one whole answer, in
  time, the connection is closed. A new connection begins with a silence, and with another question than the
  one that was open before: what a proxy delivers late is noticed by that.
* A write is one line and never repeated. Another client's SET shows in the echo, as it does over Modbus.

Nothing of this has met a real controller.
"""

from __future__ import annotations

import asyncio
import math
from collections import deque
from collections.abc import Callable, Sequence
from typing import Any, Final, Generic, TypeVar

import anyio

from ...runtime.log import Log, log
from ...values import registers as reg
from ...values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from ...values.registers import Registers
from ..address import Address
from ..connecting import Client, connected_client, disconnect
from ..watchdog import Watchdog
from . import lines

SETTLE_S: Final = 0.02
"""From connecting to the first question, as over Modbus TCP: what comes meanwhile answers nothing of ours."""
SHOWS_S: Final = 0.5
"""After a write everything is read for this long at most, until the echo shows it."""
SLOW: Final = ("GTO", "STA", "FLT", "ACT")
"""Asked for in turn, one in each read."""
LATEST: Final = 4
"""Written positions that may still show as echo: a write or two are under way, in a fast stream."""
TRIES: Final = 4
"""Of reading activation, go and echo of one moment. Both change at a stop or a start, not all the time."""

T = TypeVar("T")


class _Question(Generic[T]):
    """A line on its way, and what has arrived of its answer.

    Attributes:
        asked: the line, without its end.
        answer: what the whole answer says, or why there is none.
        received: the bytes so far.
    """

    def __init__(
        self, line: bytes, read: Callable[[bytes], T | None], loop: asyncio.AbstractEventLoop
    ) -> None:
        self.asked = line.decode().strip()
        self.answer: asyncio.Future[T] = loop.create_future()
        self.received = b""
        self._read = read

    @property
    def is_waiting(self) -> bool:
        return not self.answer.done()

    def take(self, data: bytes) -> None:
        """Take bytes; the last one of the answer ends the question, or the first wrong one."""
        self.received += data
        try:
            said = self._read(self.received)
        except ProtocolError as error:
            self.fail(error)
        else:
            if said is not None:
                self.answer.set_result(said)

    def fail(self, error: RobotiqConnectionError) -> None:
        if self.is_waiting:
            self.answer.set_exception(error)


class UrcapTransport:
    """A jaw behind the text port of Robotiq's URCap."""

    def __init__(
        self,
        address: Address,
        gripper: int | None = None,
        *,
        connect_timeout: float,
        response_timeout: float,
        log: Log = log,
    ) -> None:
        """Keep the settings; opens nothing.

        ``gripper`` is the one of several that the connection is about (SID); with None the URCap chooses.
        Timeouts are in seconds; that of a response is the time for a whole status, and for a write.
        """
        self._log = log
        self._address = address
        self._gripper = gripper
        self._connect_timeout = connect_timeout
        self._response_timeout = response_timeout
        self._client: Client | None = None
        self._line: Any = None
        """The asyncio transport of the connection, which pymodbus's types leave open."""
        self._question: _Question[Any] | None = None
        """The question on its way."""
        self._failure: RobotiqConnectionError | None = None
        """An error of the link between two questions; the next one raises it."""
        self._unanswered = ""
        """The question that the last connection ended with, if it was open."""
        self._values: dict[str, int] = {}
        """The newest value of each variable on this connection."""
        self._turn = 0
        """Which of the slow variables comes next."""
        self._changes = True
        """Whether the next read asks for everything."""
        self._positions: deque[int] = deque(maxlen=LATEST)
        """The positions that were written last: an echo of one is expected."""
        self._releases = False
        """Whether the last write set ATR."""
        self._written: tuple[int, ...] = ()
        """Activation, go and echo that the last write will show, if it changes activation or go."""
        self._shows_by = -math.inf
        """Until when that is awaited."""
        self._loop: asyncio.AbstractEventLoop
        self._watchdog: Watchdog

    @property
    def is_open(self) -> bool:
        return self._client is not None

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier question is taken for one to come.

        Raises:
            ConnectFailedError: refused or unreachable, or the URCap does not choose the gripper.
            ProtocolError: the answer is none, or bytes arrive without a question.
            ConnectionLostError: the connection was closed at once.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        await self.close()
        self._loop = loop = asyncio.get_running_loop()
        self._watchdog = Watchdog(loop, self._response_timeout, lambda: self._is_waiting, self._on_timeout)
        self._failure, self._changes, self._written = None, True, ()
        self._values.clear()
        self._positions.clear()
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
        await self._settle()
        await self._get("FLT" if self._unanswered == "GET STA" else "STA")
        self._unanswered = ""
        if self._gripper is not None:
            await self._choose(self._gripper)

    async def read(self) -> Registers:
        """The status registers of a jaw; the variables were asked for one after the other.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        by = self._now() + self._response_timeout
        if not self._changes:
            await self._read_some(by)
        if self._changes:
            await self._read_all(by)
        return lines.status_registers(self._values)

    async def send(self, decide: Callable[[], Sequence[int] | None]) -> bool:
        """Write what ``decide`` returns, if anything.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        self._check_connected()
        image = decide()
        if image is None:
            return False
        await self.write(image)
        return True

    async def write(self, registers: Sequence[int]) -> None:
        """Write the request registers with one SET, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        act, go, position = (field.read(registers) for field in (reg.rACT, reg.rGTO, reg.rPR[0]))
        self._positions.append(position)
        if self._changes or (act, go) != (self._values["ACT"], self._values["GTO"]):
            self._changes, self._shows_by = True, self._now() + SHOWS_S
            self._written = act, go, position
        shown = None if self._releases else self._values.get("ACT")
        self._releases = bool(reg.rATR.read(registers))
        await self._set(lines.command(registers, shown))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._drop()

    # -- a status ----------------------------------------------------------------------------------------

    async def _read_some(self, by: float) -> None:
        """What changes in a motion, and one of the slow variables."""
        if await self._is_new("PRE", by) and self._values["PRE"] not in self._positions:
            self._changes = True
            return
        await self._is_new("OBJ", by)
        await self._is_new("POS", by)
        slow = SLOW[self._turn]
        self._turn = (self._turn + 1) % len(SLOW)
        self._changes = await self._is_new(slow, by)

    async def _read_all(self, by: float) -> None:
        """Every variable; activation, go and echo as they were in one moment."""
        await self._read_pair(by)
        for _ in range(TRIES):
            await self._is_new("PRE", by)
            if not await self._read_pair(by):
                break
        else:
            self._drop()
            raise ProtocolError(f"{self._address}: ACT and GTO change too often to be read")
        for name in ("OBJ", "STA", "FLT", "POS"):
            await self._is_new(name, by)
        shown = tuple(self._values[name] for name in ("ACT", "GTO", "PRE"))
        if shown == self._written or self._now() >= self._shows_by:
            self._written = ()
        self._changes = bool(self._written)

    async def _read_pair(self, by: float) -> bool:
        """Read ACT and GTO; whether one of them has changed."""
        is_new = await self._is_new("ACT", by)
        return await self._is_new("GTO", by) or is_new

    async def _is_new(self, name: str, by: float) -> bool:
        """Read a variable; whether it has changed."""
        before, self._values[name] = self._values.get(name), await self._get(name, by)
        return self._values[name] != before

    # -- one question ------------------------------------------------------------------------------------

    async def _get(self, name: str, by: float = math.inf) -> int:
        return await self._ask(lines.question(name), lambda received: lines.value_in(received, name), by)

    async def _set(self, line: bytes) -> None:
        await self._ask(line, lambda received: lines.is_acknowledged(received) or None)

    async def _choose(self, gripper: int) -> None:
        try:
            await self._set(lines.choice(gripper))
        except (ProtocolError, ResponseTimeoutError) as error:
            why = f"the URCap does not choose gripper {gripper}: {error}"
            raise ConnectFailedError(str(self._address), why) from error

    async def _ask(self, line: bytes, read: Callable[[bytes], T | None], by: float = math.inf) -> T:
        """Send a line and wait for its answer; every other outcome closes the connection."""
        self._check_connected()
        question: _Question[T] = _Question(line, read, self._loop)
        self._question = question
        self._watchdog.watch(by)
        try:
            self._line.write(line)
            return await question.answer
        except RobotiqConnectionError:
            self._drop()
            raise
        except OSError as error:
            self._drop()
            raise ConnectionLostError(f"{self._address}: {error}") from error
        except BaseException:
            # Cancelled in the middle of a question: its answer must not become that of another one.
            self._drop()
            if question.answer.done() and not question.answer.cancelled():
                question.answer.exception()  # asyncio reports an exception that was never looked at
            raise
        finally:
            self._question = None

    def _check_connected(self) -> None:
        if self._failure is not None:
            # Between two questions the link broke, or bytes arrived without a question.
            failure, self._failure = self._failure, None
            self._drop()
            raise failure
        if self._client is None:
            raise ConnectionLostError(f"not connected to {self._address}")

    @property
    def _is_waiting(self) -> bool:
        return self._question is not None and self._question.is_waiting

    def _now(self) -> float:
        """The time by the loop's own clock, as the watchdog has it."""
        return asyncio.get_running_loop().time()

    def _on_timeout(self) -> None:
        question = self._question
        assert question is not None, "only a question is watched"
        half = lines.without_ends(question.received)
        what = f"half a line, {lines.show(half)}, answers" if half else "no answer to"
        self._fail(
            ResponseTimeoutError(
                f"{self._address}: {what} {question.asked} within {self._response_timeout:g} s"
            )
        )

    def _fail(self, error: RobotiqConnectionError) -> None:
        """End the question on its way with an error; without one, keep the error for the next question."""
        if self._question is not None and self._question.is_waiting:
            self._question.fail(error)
        elif self._failure is None:
            self._failure = error

    def _drop(self) -> None:
        client, self._client = self._client, None
        if client is not None:
            self._unanswered = "" if self._question is None else self._question.asked
            self._watchdog.stop()
            disconnect(client)

    # -- what the connection calls -----------------------------------------------------------------------

    def _on_data(self, data: bytes) -> None:
        if self._is_waiting:
            assert self._question is not None
            self._question.take(data)
        elif strays := lines.without_ends(data):
            self._fail(ProtocolError(f"{len(strays)} bytes without a question: {lines.show(strays)}"))

    def _on_connection(self, connected: bool) -> None:
        if not connected:
            self._fail(ConnectionLostError(f"{self._address} closed the connection"))

    async def _settle(self) -> None:
        try:
            await asyncio.sleep(SETTLE_S)
        except BaseException:
            self._drop()
            raise
        self._check_connected()
