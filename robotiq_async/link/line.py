"""A line to grippers: its state, the turns of those who use it, and one exchange at a time.

What is said on a line is a dialogue (dialogue.py): a generator that yields steps and gets what they come to.
:meth:`Line.talk` carries one out, in a turn of its user. **A dialogue that returns leaves its user on the
line. One that raises has given up the line for its user**, and so has one that is cancelled.

::

                                         silence
    CLOSED --> OPENING --> IN_STEP <-------------- HUSHING
      ^           |           |                       ^
      |           |           v                       |
      '-----------'        DISTURBED -----------------'

DISTURBED follows all that leaves a reply on its way: noise, silence, a user that left in mid-exchange. CLOSED
follows the end of the wire, the leaving of the last user, and strays where nothing forgives them: where every
byte belongs to a frame with a number (TCP) or to an answer with a name (URCap), a stray means a wrong peer.

A line may have several users, because grippers with different unit ids can hang on it. The first one opens
it and the last one closes it. Users take turns, in the order in which they ask for them, so each waits for
one turn of each other at most. What another one has left on its way must not meet a request: the turn begins
with waiting for silence then. A gripper that does not answer takes a short turn, and only once in a while
(serial/patience.py). When the wire ends, it ends for all users.
"""

from __future__ import annotations

import asyncio
import contextlib
import logging
import math
from collections.abc import Callable, Generator
from enum import Enum
from typing import Final, TypeVar
from weakref import WeakKeyDictionary, WeakValueDictionary

from ..runtime.limit import Limit
from ..runtime.logger import Log, log
from ..values.errors import ConnectFailedError, ConnectionLostError, ProtocolError, RobotiqConnectionError
from .address import Address
from .canonical import canonical_address
from .exchange import Answer, EchoFilter, Exchange
from .frames import stray
from .outcome import Lost, Noise, Outcome, Refused, Stray
from .serial.patience import LinePatience
from .serial.silence import Silence
from .watchdog import Watchdog
from .wires import Send, Wire, wire_to

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
    OPENING = "what is left over from an earlier connection; only the end of the opening leads on"
    IN_STEP = "nothing but the reply to the next request, or to the one in flight"
    DISTURBED = "a reply to an earlier request, or more noise: nothing is sent before the line was silent"
    HUSHING = "the same, which is dropped until the line is silent"


# Python 3.11 finds a member of an Enum by a detour that costs as much as a call: each poll asks for several.
CLOSED, OPENING, IN_STEP, DISTURBED, HUSHING = LineState
_IS_NEWS: Final = (OPENING, IN_STEP)
"""The states in which bytes without a request mean something new."""


class Step(Enum):
    """A wish of a dialogue other than an exchange."""

    READY = "all that a request waits for; comes to what prevents one, if anything does"
    HUSH = "silence; comes to noise if there is none"
    TURN = "that others have their turn; comes to nothing"


READY: Final = Step.READY
HUSH: Final = Step.HUSH
TURN: Final = Step.TURN

Dialogue = Generator[Exchange | Step, Answer | None, T]
"""Yields steps and gets what they come to; an exchange always comes to an answer or an outcome."""


class Line:
    """A line with its users.

    Attributes:
        state: what may arrive; changed by :meth:`_become` alone.
        why: what has disturbed the line, or ended it; None if a user did by leaving.
        forgives: whether a lost or damaged byte is no reason to give up the line.
        keeps_silence: whether this end keeps the silence between frames; a serial server keeps its own.
        silence: that silence.
        echo: whether the line brings back what is sent.
        asked_at: the time of the last request, by the loop's own clock.
    """

    def __init__(
        self,
        address: Address,
        stray: Callable[[bytes], Stray | None] = stray,
        *,
        wire: Wire | None = None,
        shares: bool = False,
        log: Log = log,
    ) -> None:
        """Keep the settings; opens nothing.

        ``stray`` says what bytes without a request mean. ``wire`` is that to the address unless given. With
        ``shares`` the line may have several users at a time. ``log`` is that of its only user.
        """
        self.state, self.why = CLOSED, None
        self.forgives: bool = address.is_rtu
        self.keeps_silence: bool = address.kind == "rtu"
        self.silence: Silence = Silence(address.line.character_s)
        self.echo: EchoFilter = EchoFilter()
        self.asked_at: float = -math.inf
        self.address: Final = address
        self._wire: Final = wire or wire_to(address)
        self._stray: Final = stray
        self._shares: Final = shares
        self._turns: Final = asyncio.Lock()
        self._users: Final[set[object]] = set()
        self._log: Final = log
        self._holders: Final[WeakKeyDictionary[object, Log]] = WeakKeyDictionary()
        """Those whose line it is, and who open it again after a loss, whether they are users now or not."""
        self._patience: Final = LinePatience()
        self._speaker: object = None
        """Who had the last turn, and has not left since."""
        self._exchange: Exchange | None = None
        """The exchange in flight."""
        self._answer: asyncio.Future[Answer]
        """The answer, or the outcome."""
        self._send: Send
        self._watchdog: Watchdog

    state: LineState
    why: Outcome | None

    def _become(self, state: LineState, why: Outcome | None = None) -> None:
        """Change the state; the log of each hand that has the line tells, at DEBUG."""
        if state is not self.state and self._log.isEnabledFor(logging.DEBUG):
            reason = "" if why is None else f" ({why.error})"
            for each in list(self._holders.values()) or [self._log]:
                each.debug("line: %s -> %s%s", self.state.name, state.name, reason)
        self.state, self.why = state, why

    @property
    def is_shared(self) -> bool:
        """Whether several have it, be they users now or about to open it again."""
        return self._shares and len(self._holders) > 1

    @property
    def is_held(self) -> bool:
        """Whether somebody will open it again."""
        return bool(self._holders)

    def is_open_for(self, user: object) -> bool:
        return user in self._users

    def now(self) -> float:
        """The time by the loop's own clock, as the watchdog has it."""
        return self._watchdog.loop.time()

    # -- its users ---------------------------------------------------------------------------------------

    async def open(self, user: object, seconds: float) -> None:
        """Connect, unless another user has; ``seconds`` at most.

        Raises:
            ConnectFailedError: refused, unreachable, no such port, or no pyserial.
            RobotiqConnectionError: the connection was closed at once, or bytes arrive without a request.
        """
        async with self._turns:
            if self.state is CLOSED:
                await self._connect(seconds)
            self._users.add(user)
            try:
                if self.address.is_socket and len(self._users) == 1:
                    await self._settle()
            except BaseException:
                self.leave(user)
                raise

    async def _connect(self, seconds: float) -> None:
        _close_left()
        self._watchdog = Watchdog(lambda: self._exchange is not None, self._on_timeout)
        self.echo.begin(may_be_on=self._wire.may_echo)
        self._become(OPENING)
        is_open = False
        try:
            with Limit(seconds):
                self._send = await self._wire.open(self._heard, self._note, seconds)
                is_open = True
            if not is_open:
                raise ConnectFailedError(str(self.address), f"no connection within {seconds:g} s")
            if self.why is not None and (isinstance(self.why, Lost) or not self.forgives):
                raise renewed(self.why.error)
        except BaseException:
            self._close()
            raise
        self._become(IN_STEP if self.why is None else DISTURBED, self.why)
        _opened[id(self)] = self
        self.silence.hear(self._watchdog.clock())  # whatever the line carried for the last connection

    async def _settle(self) -> None:
        """Wait for bytes left over from an earlier connection before the first request.

        A gateway that keeps its own connection to the gripper may send late replies to its next client. Their
        transaction ids give them away too, but only when a request is already on its way. The reply to that
        request would be left over for the next connection, and so on without end.
        """
        await asyncio.sleep(SETTLE_S)
        if self.why is not None:
            raise renewed(self.why.error)

    def hold(self, user: object, log: Log) -> None:
        """Keep the line at this rate until :meth:`release`, also while the connection is down."""
        self._holders[user] = log

    def release(self, user: object) -> None:
        """End the use of the line for good."""
        self.leave(user)
        self._holders.pop(user, None)

    def leave(self, user: object) -> None:
        """End the use of the line, between two exchanges; the last user closes it."""
        self._users.discard(user)
        if not self._users and self.state is not OPENING:
            self._close()

    def _break_off(self, user: object) -> None:
        """End the use of a line on which a reply may still come."""
        self._give_up()
        if user in self._users:
            self._become(DISTURBED)
            self._speaker = None
            self.leave(user)

    def _close(self, why: Outcome | None = None) -> None:
        if self.state is CLOSED:
            return
        self._become(CLOSED, why)
        self._users.clear()
        self._watchdog.stop()
        self._give_up(why)
        self._wire.close()

    def _give_up(self, why: Outcome | None = None) -> None:
        """End the exchange in flight, if there is one."""
        if self._exchange is not None:
            self._end(why or Lost(self._not_connected()))

    def close_if_loop_closed(self) -> None:
        """Close it if the loop was closed before."""
        if self.state is not CLOSED and self._watchdog.loop.is_closed():
            self._exchange = None  # its user has gone with the loop
            with contextlib.suppress(RuntimeError):  # asyncio's sockets tell the loop that they close
                self._close()

    # -- a dialogue --------------------------------------------------------------------------------------

    async def talk(self, user: object, dialogue: Dialogue[T]) -> T:
        """Carry out a dialogue, in a turn of this user; return what it returns.

        Raises:
            RobotiqConnectionError: the dialogue has raised it; the user has left the line.
        """
        has_begun = False
        while True:
            try:
                must_hush = self._shares and await self._take_turn(user)
            except BaseException:
                # Before the first turn the user has nothing on its way, and stays. Between two turns it may
                # have, and another one has the line: that exchange goes on.
                if has_begun:
                    self.leave(user)
                raise
            has_begun = True
            try:
                if must_hush and (noise := await self._hush()) is not None:
                    raise noise.error
                came_to: Answer | None = None
                while (step := dialogue.send(came_to)) is not TURN:
                    if step is HUSH:
                        came_to = await self._hush()
                        continue
                    if self.keeps_silence:
                        await self._keep_silence(step)
                    came_to = self._obstacle(user) if step is READY else await self._begin(user, step)
            except StopIteration as end:
                result: T = end.value
                return result
            except BaseException:
                self._break_off(user)
                raise
            finally:
                if self._shares:
                    self._turns.release()

    async def _take_turn(self, user: object) -> bool:
        """Wait until this user has the line alone; return whether another one has left a reply on its way."""
        if self.is_shared and (rest := self._patience.until(user) - self.now()) > 0:
            await asyncio.sleep(rest)
        await self._turns.acquire()
        before, self._speaker = self._speaker, user
        is_left_over = self.state is DISTURBED and not isinstance(self.why, Stray)
        return is_left_over and before is not user and user in self._users

    async def _keep_silence(self, step: Exchange | Step) -> None:
        if self.state is not CLOSED:
            is_long = not isinstance(step, Step) and step.timing.is_long
            await self.silence.keep(self._watchdog.clock, is_long=is_long)

    def _begin(self, user: object, exchange: Exchange) -> asyncio.Future[Answer]:
        """Send a request; what is returned comes to its answer, or to what prevents it."""
        self._answer = answer = self._watchdog.loop.create_future()
        if self.state is not IN_STEP or user not in self._users:
            obstacle = self._obstacle(user)
            assert obstacle is not None
            answer.set_result(obstacle)
            return answer
        self._exchange = exchange
        self.asked_at = self._watchdog.watch(self._allowed(exchange), exchange.timing.by)
        if self._shares:
            self._patience.asked(self.now())
        try:
            self._send(exchange.frame)
        except OSError as error:
            self._close(Lost(ConnectionLostError(f"{self.address}: {error}")))
        return answer

    def _allowed(self, exchange: Exchange) -> float:
        """The longest time for the answer to a request of this turn, in seconds."""
        timing = exchange.timing
        if timing.is_whole or not (self._shares and self.is_shared):
            return timing.seconds
        return self._patience.seconds(self._speaker, timing.seconds)

    def _obstacle(self, user: object) -> Outcome | None:
        """The obstacle to a request of this user."""
        if self.state is CLOSED and self.why is not None:
            return Lost(renewed(self.why.error))
        return self.why if user in self._users else Lost(self._not_connected())

    def _not_connected(self) -> ConnectionLostError:
        return ConnectionLostError(f"not connected to {self.address}")

    async def _hush(self) -> Noise | None:
        """Drop what arrives until the line is silent."""
        # Closed, the next request has the reason. Another user may have brought the line in step since.
        if self.state is CLOSED or (self.state is IN_STEP and self.is_shared):
            return None
        self._become(HUSHING)
        clock = self._watchdog.clock
        began = clock()
        until = began + HUSH_S
        while (left := until - clock()) > 0:
            if clock() - began > LONGEST_HUSH_S:
                return Noise(ProtocolError(f"{self.address}: the line does not become silent"))
            await asyncio.sleep(left)
            until = max(until, self.silence.heard + HUSH_S)
        if self.state is HUSHING:
            self._become(IN_STEP)
        return None

    # -- what the wire and the watchdog call -------------------------------------------------------------

    def _heard(self, data: bytes) -> None:
        """Take what has arrived; the last byte of the reply ends the exchange, or the first wrong one."""
        if self.forgives:
            self.silence.hear(self._watchdog.clock())
        if self._exchange is not None:
            if (answer := self._exchange.feed(data)) is not None:
                self._end(answer)
        elif self.state is HUSHING:
            self.silence.hear(self._watchdog.clock())  # and dropped
        elif (self.state in _IS_NEWS or not self.forgives) and (news := self._stray(data)) is not None:
            self._note(news)

    def _on_timeout(self) -> None:
        assert self._exchange is not None, "only an exchange is watched"
        late = self._exchange.late(self.address, self._allowed(self._exchange))
        if self._shares:
            self._patience.missed(self._speaker, self.now())
        self._end(late)

    def _end(self, answer: Answer) -> None:
        """End the exchange in flight."""
        exchange, self._exchange = self._exchange, None
        assert exchange is not None, "in flight"
        if type(answer) is bytes:
            if self._shares:
                self._patience.answered(self._speaker, self.now())
            if exchange.extra is not None:
                self._note(exchange.extra)
        elif not isinstance(answer, bytes | Refused) and self.state is not CLOSED:
            self._become(DISTURBED, answer)
        if not self._answer.done():  # as it is when its user was cancelled
            self._answer.set_result(answer)

    def _note(self, outcome: Outcome) -> None:
        """Take news that are no bytes, or that no exchange waits for, or the end of the wire."""
        if self.state is OPENING:
            self._become(OPENING, outcome)
        elif isinstance(outcome, Lost) or not self.forgives:
            self._close(outcome)
        elif self._exchange is not None:
            self._end(outcome)
        else:
            self._become(DISTURBED, outcome)


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


def shared_line(address: Address, user: object, log: Log) -> Line:
    """The line at an address, which all its users in the running event loop share.

    Held for ``user``, who has ``log``, from here on.

    Raises:
        ConnectFailedError: others hold it with another rate, parity or number of stop bits.
    """
    place = asyncio.get_running_loop(), canonical_address(address)
    line = _shared.get(place)
    if line is None or (line.address.line != address.line and not line.is_held):
        _shared[place] = line = Line(address, shares=True)
    elif line.address.line != address.line:
        raise ConnectFailedError(str(address), f"the port is in use as {line.address}")
    line.hold(user, log)
    return line
