"""A line to grippers: its state, the turns of those who use it, and one exchange at a time.

A dialogue (dialogue.py) is a generator that yields steps and gets the answer to each.
:meth:`Line.talk` carries one out, in a turn of its user. **A dialogue that returns leaves its user on the
line. One that raises has given up the line for its user**, and so has one that is cancelled.

::

                                         silence
    CLOSED --> OPENING --> IN_STEP <-------------- HUSHING
      ^           |           |                       ^
      |           |           v                       |
      '-----------'        DISTURBED -----------------'

DISTURBED follows everything that leaves a reply on its way: noise, silence, a user that left in mid-exchange.
CLOSED follows the end of the wire, the leaving of the last user, and strays where nothing forgives them:
where every byte belongs to a frame with a number (TCP) or to an answer with a name (URCap), a stray means a
wrong peer.

A line may have several users, because grippers with different unit ids can hang on it. The first one opens it
and the last one closes it. Users take turns, first come, first served, so each waits for one turn of each
other at most. A reply that another one has left on its way must not meet a request: then the turn begins with
waiting for silence. A gripper that does not answer takes a short turn, and only once in a while
(serial/patience.py). When the wire ends, it ends for all users.
"""

from __future__ import annotations

import asyncio
import contextlib
import math
from collections.abc import Callable
from enum import Enum
from typing import Final, TypeVar
from weakref import WeakKeyDictionary, WeakValueDictionary

from ..runtime.limit import Limit
from ..runtime.logger import Log
from ..values.errors import ConnectFailedError, ConnectionLostError, ProtocolError, RobotiqConnectionError
from .address import Address
from .canonical import canonical_address
from .exchange import DONE, HUSH, TURN, Dialogue, EchoFilter, Exchange, Step
from .frames import stray
from .outcome import Answer, Lost, Noise, Outcome, Refused, Stray, check
from .serial.patience import LinePatience
from .serial.silence import Silence
from .watchdog import Watchdog
from .wires import Send, SerialWire, SocketWire, Wire

SETTLE_S: Final = 0.02
"""From connecting to the first request over TCP: a few round trips of a network in a building."""
HUSH_S: Final = 0.02
"""Silence after which the rest of a damaged reply is over: a USB adapter may hold bytes back for 16 ms (the
usual latency timer of FTDI chips)."""
LONGEST_HUSH_S: Final = 0.1
"""Longest wait for that silence. A gripper that was asked one thing does not talk longer."""

T = TypeVar("T")


class LineState(Enum):
    """The state of a line, by the bytes that may arrive on it."""

    CLOSED = "nothing: there is no wire"
    OPENING = "bytes left over from an earlier connection; only the end of the opening leads on"
    IN_STEP = "nothing but the reply to the next request, or to the one in flight"
    DISTURBED = "a reply to an earlier request, or more noise: nothing is sent before the line was silent"
    HUSHING = "the same, which is dropped until the line is silent"


# Python 3.11 finds a member of an Enum by a detour that costs as much as a call: each poll needs several.
CLOSED, OPENING, IN_STEP, DISTURBED, HUSHING = LineState


class Line:
    """A line with its users.

    Attributes:
        state: the kind of bytes that may arrive; changed by :meth:`_become` alone.
        why: the outcome that has disturbed the line, or ended it; None if it was closed by its users.
        forgives: whether a lost or damaged byte is no reason to give up the line.
        silence: that between two frames.
        echo: whether the line brings back each request.
        users: those for whom it is open.
        asked_at: the time of the last request.
    """

    def __init__(
        self,
        address: Address,
        stray: Callable[[bytes], Stray | None] = stray,
        *,
        wire: Wire | None = None,
        shares: bool = False,
    ) -> None:
        """Keep the settings; opens nothing.

        ``stray`` judges bytes without a request. ``wire`` is the usual one to the address unless given. With
        ``shares`` the line may have several users at a time.
        """
        self.state: LineState = CLOSED
        self.why: Outcome | None = None
        self.forgives: Final = address.is_rtu
        is_port = address.kind == "rtu"
        self.silence: Final = Silence(address.line.character_s if is_port else 0.0)
        self.echo: Final = EchoFilter()
        self.asked_at: float = -math.inf
        self.address: Final = address
        self._wire: Final = wire or (SerialWire if is_port else SocketWire)(address)
        self._stray: Final = stray
        self._shares: Final = shares
        self._turns: Final = asyncio.Lock()
        self.users: Final[set[object]] = set()
        self._holders: Final[WeakKeyDictionary[object, Log]] = WeakKeyDictionary()
        """The logs of those who open it again after a loss, whether they are users now or not."""
        self._patience: Final = LinePatience()
        self._speaker: object = None
        """Who had the last turn, and has not left since."""
        self._in_flight: tuple[Exchange, asyncio.Future[Answer], float] | None = None
        """The exchange in flight, the future of its answer, and the longest time for that in seconds."""
        self._send: Send
        self._watchdog: Watchdog

    @classmethod
    def shared(cls, address: Address) -> Line:
        """The line at an address, which all its users in the running event loop share.

        Raises:
            ConnectFailedError: others hold it with another rate, parity or number of stop bits.
        """
        place = asyncio.get_running_loop(), canonical_address(address)
        line = _shared.get(place)
        if line is None or not (line._holders or line.address.line == address.line):  # noqa: SLF001
            line = _shared[place] = cls(address, shares=True)
        elif line.address.line != address.line:
            raise ConnectFailedError(str(address), f"the port is in use as {line.address}")
        return line

    def _become(self, state: LineState, why: Outcome | None = None) -> None:
        """Change the state; the log of each hand that has the line tells, at DEBUG."""
        if state is not self.state:
            reason = "" if why is None else f" ({why.error})"
            for each in list(self._holders.values()):
                each.debug("line: %s -> %s%s", self.state.name, state.name, reason)
        self.state, self.why = state, why

    @property
    def is_shared(self) -> bool:
        """Whether several have it, be they users now or about to open it again."""
        return self._shares and len(self._holders) > 1

    def now(self) -> float:
        return self._watchdog.clock()

    # -- its users ---------------------------------------------------------------------------------------

    async def open(self, user: object, seconds: float, log: Log) -> None:
        """Connect, unless another user has; ``seconds`` at most.

        The line is held for the user, who has ``log``, until :meth:`release`, also while it is closed.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            RobotiqConnectionError: the connection was closed at once, or bytes arrive without a request.
        """
        self._holders[user] = log
        async with self._turns:
            if self.state is CLOSED:
                await self._connect(seconds)
            self.users.add(user)

    async def _connect(self, seconds: float) -> None:
        _close_left()
        self._watchdog = Watchdog(self._on_timeout)
        self.echo.learn(is_on=None)
        self._become(OPENING)
        try:
            with Limit(seconds) as limit:
                self._send = await self._wire.open(self._heard, self._note, seconds)
            if limit.is_over:
                raise ConnectFailedError(str(self.address), f"no connection within {seconds:g} s")
            if self.address.is_socket:
                # A gateway that keeps its own connection to the gripper may send late replies to its next
                # client. Their transaction ids give them away too, but only when a request is already on its
                # way. The reply to that request would be left over for the next connection, and so on
                # without end.
                await asyncio.sleep(SETTLE_S)
            if self.why is not None and (isinstance(self.why, Lost) or self.address.is_socket):
                raise renewed(self.why.error)
        except BaseException:
            self._close()
            raise
        self._become(IN_STEP if self.why is None else DISTURBED, self.why)
        _opened[id(self)] = self
        self.silence.hear(self._watchdog.clock())  # for frames of the last connection

    def release(self, user: object) -> None:
        """End the use of the line for good."""
        self.leave(user)
        self._holders.pop(user, None)

    def leave(self, user: object) -> None:
        """End the use of the line, between two exchanges; the last user closes it."""
        self.users.discard(user)
        if not self.users and self.state is not OPENING:
            self._close()

    def _break_off(self, user: object) -> None:
        """End the use of a line on which a reply may still come."""
        if self._in_flight is not None or user in self.users:
            self._end(self._lost())
            self._speaker = None
            self.leave(user)

    def _close(self, why: Outcome | None = None) -> None:
        if self.state is not CLOSED:
            self._become(CLOSED, why)
            self.users.clear()
            self._watchdog.stop()
            self._end(self._lost())
            self._wire.close()

    def close_if_loop_closed(self) -> None:
        """Close it if the loop was closed before."""
        if self.state is not CLOSED and self._watchdog.loop.is_closed():
            self._in_flight = None  # its user has gone with the loop
            with contextlib.suppress(RuntimeError):  # asyncio's sockets tell the loop that they close
                self._close()

    # -- a dialogue --------------------------------------------------------------------------------------

    async def talk(self, user: object, dialogue: Dialogue[T]) -> T:
        """Carry out a dialogue, in a turn of this user; return its result.

        Raises:
            RobotiqConnectionError: the dialogue has raised it; the user has left the line.
        """
        step: Exchange | Step | None = None
        while True:
            must_hush = self._shares and await self._take_turn(user, has_begun=step is not None)
            try:
                if must_hush:
                    check(await self._hush())
                step = next(dialogue)
                while step is not TURN:
                    if step is HUSH:
                        came_to = await self._hush()
                    else:
                        if self.silence.short_s and self.state is not CLOSED:
                            is_long = not isinstance(step, Step) and step.timing.is_long
                            await self.silence.keep(self._watchdog.clock, is_long=is_long)
                        why = self.why if user in self.users else self._lost()
                        came_to = why or (DONE if isinstance(step, Step) else await self._begin(step))
                    step = dialogue.send(came_to)
            except StopIteration as end:
                result: T = end.value
                return result
            except BaseException:
                self._break_off(user)
                raise
            finally:
                if self._shares:
                    self._turns.release()

    async def _take_turn(self, user: object, *, has_begun: bool) -> bool:
        """Wait until this user has the line alone; return whether another one has left a reply on its way."""
        try:
            if self.is_shared and (rest := self._patience.until(user) - self.now()) > 0:
                await asyncio.sleep(rest)
            await self._turns.acquire()
        except BaseException:
            # Before the first turn the user has nothing on its way, and stays. Between two turns it may have,
            # and another one has the line, whose exchange must not end.
            if has_begun:
                self.leave(user)
            raise
        before, self._speaker = self._speaker, user
        is_left_over = self.state is DISTURBED and not isinstance(self.why, Stray)
        return is_left_over and before is not user and user in self.users

    def _lost(self) -> Lost:
        """The outcome for one who is no user of the line, or no more."""
        if self.state is CLOSED and self.why is not None:
            return Lost(renewed(self.why.error))
        return Lost(ConnectionLostError(f"not connected to {self.address}"))

    def _begin(self, exchange: Exchange) -> asyncio.Future[Answer]:
        """Send a request; return the future of its answer."""
        timing = exchange.timing
        seconds = timing.seconds
        if self._shares and self.is_shared and not timing.is_whole:
            seconds = self._patience.seconds(self._speaker, seconds)
        answer: asyncio.Future[Answer] = self._watchdog.loop.create_future()
        self._in_flight = exchange, answer, seconds
        self.asked_at = self._watchdog.watch(seconds, timing.by)
        try:
            self._send(exchange.frame)
        except OSError as error:
            self._close(Lost(ConnectionLostError(f"{self.address}: {error}")))
        return answer

    async def _hush(self) -> Answer:
        """Drop all bytes until the line is silent."""
        # Closed, the next request has the reason. Another user may have brought the line in step since.
        if self.state is CLOSED or (self.state is IN_STEP and self.is_shared):
            return DONE
        self._become(HUSHING)
        clock, silence = self._watchdog.clock, self.silence
        silence.hear(began := clock())
        while (left := silence.heard + HUSH_S - clock()) > 0:
            if clock() - began > LONGEST_HUSH_S:
                noise = Noise(ProtocolError(f"{self.address}: the line does not become silent"))
                self._end(noise)
                return noise
            await asyncio.sleep(left)
        if self.state is HUSHING:
            self._become(IN_STEP)
        return DONE

    # -- called by the wire and the watchdog -------------------------------------------------------------

    def _heard(self, data: bytes) -> None:
        """Take bytes; the last one of the reply ends the exchange, or the first wrong one."""
        if self.forgives or self.state is HUSHING:
            self.silence.hear(self._watchdog.clock())
        if self._in_flight is not None:
            if (answer := self._in_flight[0].feed(data)) is not None:
                self._end(answer)
        elif self.state is HUSHING or (self.state is DISTURBED and self.forgives):
            pass  # the rest of something earlier
        elif (news := self._stray(data)) is not None:
            self._note(news)

    def _note(self, outcome: Outcome) -> None:
        """Take news without bytes, bytes for no exchange, or the end of the wire."""
        if self.state is OPENING:
            self._become(OPENING, outcome)
        elif isinstance(outcome, Lost) or not self.forgives:
            self._close(outcome)
        else:
            self._end(outcome)

    def _on_timeout(self) -> None:
        if self._in_flight is not None:
            exchange, _, seconds = self._in_flight
            self._end(exchange.late(self.address, seconds))

    def _end(self, answer: Answer) -> None:
        """End the exchange in flight, if there is one; without a whole reply, more may come."""
        if isinstance(answer, Outcome) and not isinstance(answer, Refused) and self.state is not CLOSED:
            self._become(DISTURBED, answer)
        if self._in_flight is None:
            return
        (exchange, comes_to, _), self._in_flight = self._in_flight, None
        if self._shares:
            self._patience.note(self._speaker, answer, self.asked_at, self.now())
        if exchange.extra is not None:
            self._note(exchange.extra)
        if not comes_to.done():  # as it is when its user was cancelled
            comes_to.set_result(answer)


def renewed(error: RobotiqConnectionError) -> RobotiqConnectionError:
    """The same error without its traceback: several users may raise it, and several times."""
    return type(error)(error.message)


_opened: Final[WeakValueDictionary[int, Line]] = WeakValueDictionary()
"""The lines that have been opened, of all loops."""


def _close_left() -> None:
    """Close the lines of loops that were closed under their hands: a serial port has one owner."""
    for reference in _opened.valuerefs():  # a copy: threads make connections at any time
        if (line := reference()) is not None:
            line.close_if_loop_closed()


_shared: Final[WeakValueDictionary[tuple[asyncio.AbstractEventLoop, str], Line]] = WeakValueDictionary()
