"""A connection to a gripper, and the exchanges on it, one at a time.

A connection to a serial line may have several users, because grippers with different unit ids can hang on the
line. The first user opens the connection and the last one closes it.

Users take turns, in the order in which they ask for them, so each waits for one turn of each other at most. A
user whose exchange fails leaves, as it would close a connection of its own. The reply that it waited for may
still come, and must not meet the request of another user: the next turn begins with waiting for silence. A
gripper that does not answer takes a turn only once in a while (REST_S). When the connection itself ends, it
ends for all users.
"""

from __future__ import annotations

import asyncio
import contextlib
from collections.abc import Callable
from typing import Any, Final, TypeVar
from weakref import WeakKeyDictionary, WeakSet, WeakValueDictionary

from ..runtime.clock import clock_of
from ..runtime.limit import Limit
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    ProtocolError,
    ResponseTimeoutError,
    RobotiqConnectionError,
)
from .address import Address, canonical_address
from .exchange import Echo, Exchange, strays
from .frames import MisfitError, RefusedError
from .silence import Silence
from .watchdog import Watchdog
from .wires import Send, wire_to

SETTLE_S: Final = 0.02
"""From connecting to the first request over TCP: a few round trips of a network in a building."""
HUSH_S: Final = 0.02
"""Silence after which the rest of a damaged reply is over: a USB adapter may hold bytes back for 16 ms (the
usual latency timer of FTDI chips)."""
LONGEST_HUSH_S: Final = 0.1
"""Longest wait for that silence. A gripper that was asked one thing does not talk longer."""

REST_S: Final = 0.1
"""From the end of an exchange without a reply to the next turn of its user on a line that others use: time
for 20 polls of theirs."""

NOISE: Final = (MisfitError, ResponseTimeoutError)
"""Errors that a lost or damaged byte can cause."""

T = TypeVar("T")

Bears = Callable[[RobotiqConnectionError], bool]
"""Whether the connection stays open after an error."""
Strays = Callable[[bytes], ProtocolError | None]
"""The error for bytes that answer nothing; None if they mean nothing."""


def bears_nothing(_: RobotiqConnectionError) -> bool:
    """For an exchange after which every error ends the connection."""
    return False


class StillOpenError(Exception):
    """An error that left the connection open, in ``error``: the caller brings the line back in step."""

    def __init__(self, error: RobotiqConnectionError) -> None:
        super().__init__(str(error))
        self.error = error


class Turn:
    """The turn of one user, which ends with the block: ``with await connection.turn(user):``."""

    # A generator would cost a poll as much as its request does.
    def __init__(self, lock: asyncio.Lock) -> None:
        self._lock = lock

    def __enter__(self) -> None: ...

    def __exit__(self, *_: object) -> None:
        self._lock.release()


class Connection:
    """A connection, TCP or serial, with its users.

    Attributes:
        silence: between the frames of a serial line.
        keeps_silence: whether this end must keep it; a serial server keeps its own.
        echo: whether the line brings back what is sent.
    """

    def __init__(self, address: Address, strays: Strays = strays) -> None:
        """Keep the address; opens nothing."""
        self._turns = asyncio.Lock()
        self._turn = Turn(self._turns)
        self.silence = Silence(address.line.character_s)
        self.keeps_silence = not address.is_socket
        self.echo = Echo()
        self._address = address
        self._is_rtu = address.is_rtu
        self._strays = strays
        self._users: set[object] = set()
        self._holders: WeakSet[object] = WeakSet()
        """Those whose line it is, and who open it again after a loss, whether they are users now or not."""
        self._rests: WeakKeyDictionary[object, float] = WeakKeyDictionary()
        """The time of the next turn of a user whose gripper did not answer, by the clock of the loop."""
        self._wire = wire_to(address)
        self._send: Send | None = None
        """Sends a frame; None while there is no connection."""
        self._exchange: Exchange[Any] | None = None
        """The exchange in flight."""
        self._failure: RobotiqConnectionError | None = None
        """An error of the link between two exchanges; the next exchange raises it."""
        self._end: RobotiqConnectionError | None = None
        """The reason for which the last connection has ended for all of its users, if it has."""
        self._is_hushing = False
        """Whether arriving bytes are dropped as the rest of a damaged reply."""
        self._is_disturbed = False
        """Whether a reply to a user that has left may still come."""
        self._allowed_s = 0.0
        """Seconds that the exchange in flight may take."""
        self._loop: asyncio.AbstractEventLoop
        self.clock: Callable[[], float]
        self._watchdog: Watchdog

    @property
    def address(self) -> Address:
        return self._address

    @property
    def is_shared(self) -> bool:
        """Whether it has several users now."""
        return len(self._users) > 1

    @property
    def is_held(self) -> bool:
        """Whether somebody will open it again."""
        return bool(self._holders)

    def is_open_for(self, user: object) -> bool:
        return user in self._users

    async def open(self, user: object, seconds: float) -> None:
        """Connect, unless another user has; ``seconds`` at most.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            RobotiqConnectionError: the connection was closed at once, or bytes arrive without a request.
        """
        async with self._turns:
            if self._send is None:
                await self._connect(seconds)
            self._users.add(user)
            try:
                if self._address.is_socket and not self.is_shared:
                    await self._settle()
            except BaseException:
                self.leave(user)
                raise

    async def _connect(self, seconds: float) -> None:
        _disconnect_abandoned()
        self._loop = loop = asyncio.get_running_loop()
        self.clock = clock_of(loop)
        self._watchdog = Watchdog(loop, lambda: self._is_waiting, self._on_timeout)
        self._failure, self._end, self._is_disturbed = None, None, False
        self.echo.is_on = None if self._is_rtu else False
        with Limit(seconds):
            self._send = await self._wire.open(self._on_data, self._fail, seconds)
        if self._send is None:
            raise ConnectFailedError(str(self._address), f"no connection within {seconds:g} s")
        _connected[id(self)] = self
        self.silence.heard = self.clock()  # whatever the line carried for the last connection

    async def _settle(self) -> None:
        """Wait for bytes left over from an earlier connection before the first request.

        A gateway that keeps its own connection to the gripper may send late replies to its next client. Their
        transaction ids give them away too, but only when a request is already on its way. The reply to that
        request would be left over for the next connection, and so on without end.
        """
        await asyncio.sleep(SETTLE_S)
        if self._failure is not None:
            raise plain(self._failure)

    def leave(self, user: object) -> None:
        """End the use of the connection; the last user disconnects."""
        self._users.discard(user)
        if not self._users:
            self._disconnect()

    def hold(self, user: object) -> None:
        """Keep the line at this rate until :meth:`release`, also while the connection is down."""
        self._holders.add(user)

    def release(self, user: object) -> None:
        """End the use of the connection for good."""
        self._holders.discard(user)
        self.leave(user)

    def _abandon(self, user: object) -> None:
        """End the use of a connection to which a reply may still come."""
        self._is_disturbed = True
        self.leave(user)

    def _disconnect(self) -> None:
        send, self._send = self._send, None
        self._users.clear()
        if send is not None:
            self._watchdog.stop()
            self._wire.close()

    def disconnect_if_abandoned(self) -> None:
        """Disconnect if the loop was closed before."""
        if self._send is not None and self._loop.is_closed():
            with contextlib.suppress(RuntimeError):  # asyncio's sockets tell the loop that they close
                self._disconnect()

    # -- one exchange, by the user whose turn it is -----------------------------------------------------

    async def turn(self, user: object) -> Turn:
        """Wait until this user has the connection alone."""
        if self.is_shared and (rest := self._rests.get(user, 0.0) - self.clock()) > 0:
            await asyncio.sleep(rest)
        await self._turns.acquire()
        if self._is_disturbed and user in self._users:
            try:
                await self.hush(user)
            except BaseException:
                self._turns.release()
                raise
        return self._turn

    async def pause(self, user: object) -> None:
        """Keep the silence between frames: what follows sooner may be taken for part of the last frame."""
        if not self.keeps_silence or self._send is None:
            return
        try:
            await self.silence.keep(self.clock)
        except BaseException:
            self._abandon(user)
            raise

    def has_noise(self) -> bool:
        """Whether bytes have come since the last exchange that a disturbance can explain."""
        return self._failure is not None and self.is_noise(self._failure)

    def check_open(self, user: object) -> None:
        """Raise what has happened to the connection since the last exchange, if anything has."""
        if self._failure is not None:
            # Between two requests the link broke, or bytes arrived without a request.
            failure, self._failure = self._failure, None
            self._drop(user, failure)
            raise plain(failure)
        if user not in self._users:
            reason = f"not connected to {self._address}" if self._end is None else self._end.message
            raise ConnectionLostError(reason)

    async def exchange(
        self, user: object, exchange: Exchange[T], seconds: float, by: float, bears: Bears = bears_nothing
    ) -> T:
        """Send one request after the silence between frames, and wait for its reply.

        Every other outcome closes the connection for this user.

        Args:
            user: who sends it.
            exchange: the request, and the check of its reply.
            seconds: the longest time from the request to the end of the reply.
            by: when it must be over even so, in the loop's time.
            bears: whether the connection stays open after an error, and StillOpenError is raised.
        """
        if self.keeps_silence:
            await self.pause(user)
        failure = self._failure
        if failure is not None and bears(failure):
            self._failure = None
            raise StillOpenError(failure)
        self.check_open(user)
        self._exchange, self._allowed_s = exchange, seconds
        self._watchdog.watch(min(self._loop.time() + seconds, by))
        try:
            assert self._send is not None, "its users are connected"
            self._send(exchange.frame)
            return await exchange.answer
        except RobotiqConnectionError as error:
            if isinstance(error, ResponseTimeoutError):
                self._rests[user] = self.clock() + REST_S
            if bears(error):
                self._is_disturbed = self.is_shared
                raise StillOpenError(error) from None
            self._drop(user, error)
            raise plain(error) from None
        except OSError as error:
            self._disconnect()
            raise ConnectionLostError(f"{self._address}: {error}") from error
        except BaseException:
            # Cancelled in the middle of an exchange: its answer must not become that of another one.
            self._abandon(user)
            if exchange.answer.done() and not exchange.answer.cancelled():
                exchange.answer.exception()  # asyncio reports an exception that was never looked at
            raise
        finally:
            self._exchange = None

    async def hush(self, user: object) -> None:
        """Drop what arrives until the line is silent.

        Raises:
            ProtocolError: the line does not become silent; the connection is closed.
        """
        began = self.clock()
        self._is_hushing, until = True, began + HUSH_S
        if isinstance(self._failure, ProtocolError):
            self._failure = None  # more of the damaged reply came before this task ran
        try:
            while (left := until - self.clock()) > 0:
                if self.clock() - began > LONGEST_HUSH_S:
                    raise ProtocolError(f"{self._address}: the line does not become silent")
                await asyncio.sleep(left)
                until = max(until, self.silence.heard + HUSH_S)
        except BaseException:
            self._abandon(user)
            raise
        finally:
            self._is_hushing = False
        self._is_disturbed = False

    def is_noise(self, error: RobotiqConnectionError) -> bool:
        """Whether a lost or damaged byte of a serial line can be the cause."""
        return self._is_rtu and isinstance(error, NOISE)

    def _drop(self, user: object, error: RobotiqConnectionError) -> None:
        if isinstance(error, ConnectionLostError):
            self._end = error
            self._disconnect()
        else:
            self._abandon(user)

    @property
    def _is_waiting(self) -> bool:
        return self._exchange is not None and self._exchange.is_waiting

    def _on_timeout(self) -> None:
        assert self._exchange is not None, "only an exchange is watched"
        self._fail(ResponseTimeoutError(self._exchange.late(self._address, self._allowed_s)))

    def _fail(self, error: RobotiqConnectionError) -> None:
        """End the exchange in flight with an error; without one, keep the error for the next exchange."""
        if self._exchange is not None and self._exchange.is_waiting:
            self._exchange.fail(error)
        elif self._failure is None or not self.is_noise(error):
            self._failure = error

    # -- what the connection calls ---------------------------------------------------------------------

    def _on_data(self, data: bytes) -> None:
        """Take what has arrived; the last byte of the reply ends the exchange, or the first wrong one."""
        if self._is_rtu:
            self.silence.heard = self.clock()
            if self._is_hushing:
                return
        if self._exchange is not None and self._exchange.is_waiting:
            error = self._exchange.take(data)
        else:
            error = self._strays(data)
        if error is not None:
            self._fail(error)


_connected: Final[WeakValueDictionary[int, Connection]] = WeakValueDictionary()
"""The connections that have been made, of all loops."""


def _disconnect_abandoned() -> None:
    """Close the connections of loops that were closed under their hands: a serial port has one owner."""
    for reference in _connected.valuerefs():  # a copy: threads make connections at any time
        if (connection := reference()) is not None:
            connection.disconnect_if_abandoned()


_shared: WeakValueDictionary[tuple[asyncio.AbstractEventLoop, str], Connection] = WeakValueDictionary()


def shared_connection(address: Address, user: object) -> Connection:
    """The connection to a serial line, which all its users in the running event loop share.

    Held for ``user`` from here on.

    Raises:
        ConnectFailedError: others hold it with another rate, parity or number of stop bits.
    """
    place = asyncio.get_running_loop(), canonical_address(address)
    connection = _shared.get(place)
    if connection is None or (connection.address.line != address.line and not connection.is_held):
        _shared[place] = connection = Connection(address)
    elif connection.address.line != address.line:
        raise ConnectFailedError(str(address), f"the port is in use as {connection.address}")
    connection.hold(user)
    return connection


def plain(error: RobotiqConnectionError) -> RobotiqConnectionError:
    """The error as users see it: some kinds are for the link alone."""
    return ProtocolError(error.message) if isinstance(error, MisfitError | RefusedError) else error
