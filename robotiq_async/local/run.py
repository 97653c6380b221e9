"""A run of a hand: the one task that owns the link, from the first contact to the disconnection.

No other task touches the transport: callers leave their requests with the controller and wait. So no exchange
is cancelled in flight, except when a stop has waited for it long enough; then the link is closed with it.
start() and stop() may be called from different tasks.
"""

# Theory of operation
#
# State        Since                                        Until
#
# CONNECTING   the making                                   the first status, a stop, or there is no gripper
# POLLING      the first status, or the link is back        the link fails, a stop, or a bug
# LOST         the link failed                              the link is back or given up, or a stop
# ENDING       request_stop(), also by the run itself       the fingers are stopped and the link is closed
# OVER         end_with()                                   -
#
# _become() alone sets the state, and _NEXT has the order. A stop may come in any turn of the loop, also in
# the turn in which a link was opened: after each wait the state is read again, and ENDING never goes back.
#
# ENDING takes no requests. An Ending has its level and its time. A run that ends by itself requests
# its own stop: the link was given up or never opened, or its task was cancelled.
#
# A run has ended by a stop, unless `failure` is set: the error of a link that was given up, or of a bug.
# why_over() makes the error for everybody who waits then.

from __future__ import annotations

import asyncio
import contextlib
import importlib
from collections.abc import Callable, Mapping
from enum import Enum
from time import strftime
from typing import Final, NamedTuple

from ..control.controller import NextWrite
from ..control.waiters import fail, resolve
from ..runtime.limit import Limit
from ..values.enums import StopLevel
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    NotStartedError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqError,
    of_hand,
)
from .cycle import STOP
from .ending import IN_FLIGHT_S, Ending
from .opening import Opener
from .poller import Poller, RunParts

# anyio loads its backend at its first use, which would hold up the loop for some 20 ms when a hand starts.
# The name of the backend is not documented; if it changes, it only costs those 20 ms.
with contextlib.suppress(ImportError):
    importlib.import_module("anyio._backends._asyncio")

STOP_PAUSE_S: Final = 0.05  # between two attempts to stop the fingers
WRITE_SOON_S: Final = 0.05
"""Callers and listeners wait for a write that is expected within this time. A slow gateway takes longer."""


class RunState(Enum):
    """The course of a run."""

    CONNECTING = "the link is opened for the first time"
    POLLING = "the link is open"
    LOST = "the link is down, and opened again"
    ENDING = "the fingers are stopped, if they are to be, and the link is closed"
    OVER = "the link is closed"


_NEXT: Final[Mapping[RunState, frozenset[RunState]]] = {
    RunState.CONNECTING: frozenset({RunState.POLLING, RunState.ENDING, RunState.OVER}),
    RunState.POLLING: frozenset({RunState.LOST, RunState.ENDING, RunState.OVER}),
    RunState.LOST: frozenset({RunState.POLLING, RunState.ENDING, RunState.OVER}),
    RunState.ENDING: frozenset({RunState.OVER}),
    RunState.OVER: frozenset(),
}


class Down(NamedTuple):
    """A link that is down: the newest reason, and the time of day since when."""

    why: RobotiqConnectionError
    since: str


class Run:
    """Owns the link of one hand from start to stop; :meth:`run` is the body of its task.

    Attributes:
        state: the present state.
        connected: done after the first status; holds the error if no status came.
        down: the reason while the link is down; it stays if the link was given up.
        failure: the error that has ended the run; None after a stop.
    """

    def __init__(self, parts: RunParts, ended: Callable[[], None] = lambda: None) -> None:
        """``ended`` is called once, in the turn of the loop in which the run ends."""
        self.state: RunState = RunState.CONNECTING
        self.connected: Final[asyncio.Future[None]] = asyncio.get_running_loop().create_future()
        self.down: Down | None = None
        self.failure: BaseException | None = None
        self._ended: Final = ended
        self._parts: Final = parts
        self._loop: Final = asyncio.get_running_loop()
        self._poller: Final = Poller(parts)
        self._opener: Final = Opener(self._connect, parts.options)
        self._in_flight: Final = Limit()  # of the exchange in flight when a stop comes
        self._ending: Ending | None = None

    def _become(self, state: RunState) -> None:
        assert state in _NEXT[self.state], f"{self.state.name} -> {state.name}"
        self._parts.options.log.debug("run: %s -> %s", self.state.name, state.name)
        self.state = state

    # -- requests of others -----------------------------------------------------------------------------

    def note_request(self) -> None:
        """A request was made: begin the next cycle at once if it may begin with its write.

        Callers and readers that must not hear of it before its write wait for the write, if that is near.
        """
        publisher, write = self._parts.publisher, self._poller.hurry()
        if write is not None and (write.is_stop or publisher.has_ended_callers) and self._is_soon(write):
            publisher.hold_back(publication=write.is_stop)
        elif not publisher.has_to_tell:
            publisher.answer_ended()
        publisher.publish_changes()

    def _is_soon(self, write: NextWrite) -> bool:
        return self.state is RunState.POLLING and self._poller.delay_of(write) <= WRITE_SOON_S

    def request_stop(self, *, halt: bool, keep_grip: bool = False) -> None:
        """End the task as a :class:`StopLevel` says; the strongest of several requests counts. Never blocks.

        From here on the controller refuses every request and has dropped the requests that were not sent:
        between the read and the write of this cycle it would still take one and begin a motion.
        """
        level = StopLevel.of(halt=halt, keep_grip=keep_grip)
        if self._ending is None:
            # A halt, a reset or a hold that is not over is dropped with the rest: this stop must replace it.
            level = max(level, StopLevel.KEEP) if self._parts.controller.has_open_stop else level
            self._ending = Ending(level, self._parts.options.log)
            if self.state is not RunState.CONNECTING:
                self._in_flight.restart(IN_FLIGHT_S)
            if level > StopLevel.LEAVE and self._is_soon(STOP):
                self._parts.publisher.hold_back(publication=True)
                self._poller.tick.hurry()
            self._become(RunState.ENDING)
            self._parts.controller.refuse_requests()
            if not self._parts.publisher.has_to_tell:
                self._parts.publisher.tell()
        elif self._ending.strengthen(level) and level is StopLevel.SHUTDOWN:
            self._parts.controller.keep_no_grip()
        self._opener.end()

    def link_error(self) -> RobotiqConnectionError:
        """Make the error for a link that is down, with the reason if that is known."""
        down = self.down
        why = "" if down is None else f": {down.why} (down since {down.since})"
        error = ConnectionLostError(f"the link is down{why}")
        error.__cause__ = None if down is None else down.why
        return of_hand(error, self._parts.options.given_name)

    def why_over(self) -> RobotiqError:
        """Make the error for everybody who waits for a run that is over."""
        if self.failure is None:
            return NotStartedError("the hand was stopped")
        if isinstance(self.failure, RobotiqConnectionError):
            return self.link_error()
        return ConnectionLostError(f"internal error: {self.failure!r}")

    # -- its course ------------------------------------------------------------------------------------

    async def run(self, wait: float = 0.0) -> None:
        """Own the link until a stop is requested, or until the link is given up.

        Args:
            wait: seconds to keep trying for the first status.
        """
        bug: BaseException | None = None
        try:
            try:
                if await self._connect_first(wait):
                    with self._in_flight:
                        await self._poll()
                    if self._in_flight.is_over:
                        self._lose(ResponseTimeoutError("no answer until the hand was stopped"))
            finally:
                # The task of a closed loop is ended when it is collected, by any thread.
                if not self._loop.is_closed():
                    await self._finish()
        except Exception as error:
            bug = error
            raise
        finally:
            # In this turn: a stop() in a turn between would strengthen an ending that has ended, and be lost.
            if not self._loop.is_closed():
                self.end_with(bug)

    def end_with(self, bug: BaseException | None) -> None:
        """The run is over, perhaps before its task ran: no caller may wait for it. Idempotent."""
        if self.state is RunState.OVER:
            return
        if bug is not None:
            self._parts.options.log.critical("the task that owns the link failed", exc_info=bug)
            self.failure = bug
        self._become(RunState.OVER)
        stopped = NotStartedError("the hand was stopped while it connected")
        fail([self.connected], stopped if self.failure is None else self.why_over())
        self._ended()

    # -- connecting ------------------------------------------------------------------------------------

    async def _connect_first(self, wait: float) -> bool:
        try:
            connected = await self._opener.first(wait)
        except RobotiqConnectionError as error:
            if not self.connected.done():  # start() may have been cancelled
                self.connected.set_exception(error)
            return False
        if not connected or self.state is not RunState.CONNECTING:
            return False
        self._become(RunState.POLLING)
        resolve([self.connected])
        policy = self._parts.options.policy
        # From here on the reconnect policy decides about activations.
        self._parts.controller.allow_activation(policy is not None and policy.activate)
        return True

    async def _connect(self) -> None:
        """Open the link and read the first status; read on while its fault 0x09 may be a passing one."""
        await self._open()
        self._poller.break_period()
        await self._poller.read(is_first=True)
        while self._parts.controller.evidence.is_undecided:  # the silence before may show as a fault, once
            await asyncio.sleep(self._parts.options.poll_interval)
            await self._poller.read()
        self._poller.start_ticking()

    async def _open(self) -> None:
        try:
            await self._parts.link.open()
        except RobotiqConnectionError:
            raise
        except Exception as error:
            if self.state is RunState.CONNECTING:
                raise  # a bug
            # No thread, no memory, no descriptor: the next try may find them.
            self._parts.options.log.debug("the link could not be opened", exc_info=error)
            raise ConnectFailedError(self._parts.options.link.address, repr(error)) from error

    # -- polling ---------------------------------------------------------------------------------------

    async def _poll(self) -> None:
        poller, publisher, polling = self._poller, self._parts.publisher, RunState.POLLING
        while self.state is polling:
            is_regular = poller.note_ticks(await poller.tick.wait())
            if self.state is not polling:
                return
            try:
                await poller.cycle()
                if publisher.has_to_tell and self.state is polling:
                    publisher.tell()
                if not is_regular:
                    poller.break_period()
            except RobotiqConnectionError as error:
                await self._reconnect(error)

    async def _reconnect(self, why: RobotiqConnectionError) -> None:
        """Open the link again, unless a stop comes; if it is given up, the run has failed."""
        log, policy, since = self._parts.options.log, self._parts.options.policy, self._loop.time()
        log.warning("link lost: %s", why)
        self._note_down(why)
        if self.state is RunState.POLLING:
            self._become(RunState.LOST)
        self._lose(why)
        try:
            connected = policy is not None and await self._opener.again(policy, self._note_down)
        except RobotiqConnectionError as error:
            self._note_down(error)
            self.failure = error
            return
        if self.state is not RunState.LOST:
            return  # a stop came
        if not connected:
            self.failure = why
            return
        self.down = None
        self._become(RunState.POLLING)
        self._parts.counters.note_reconnect()
        log.warning("link back after %.2f s", self._loop.time() - since)

    def _note_down(self, why: RobotiqConnectionError) -> None:
        """The newest reason counts: the first one is often the least telling."""
        self.down = Down(why, strftime("%H:%M:%S") if self.down is None else self.down.since)
        self._parts.controller.machine.note_down(f"{why} (down since {self.down.since})")

    def _lose(self, why: RobotiqConnectionError) -> None:
        self._parts.controller.lost(why, self._poller.tick.time())
        self._parts.publisher.tell()

    # -- the end ---------------------------------------------------------------------------------------

    async def _finish(self) -> None:
        """Stop the fingers if there is time, then disconnect."""
        if self._ending is None:
            # A hand that has only looked leaves the fingers to the client that moves them.
            has_written = self._parts.counters.has_begun_to_write
            self.request_stop(halt=has_written, keep_grip=self._parts.options.keep_grip)
        assert self._ending is not None, "it was requested"
        try:
            await self._ending.carry_out(self._stop_fingers, self._close)
        finally:
            if not self._loop.is_closed():
                self._poller.tick.close()

    async def _close(self) -> None:
        if not self._loop.is_closed():
            self._parts.publisher.tell()
            await self._parts.link.close()

    async def _stop_fingers(self) -> None:
        """Clear rGTO and see it, trying until the time is over. Unlike a motion, a stop may be sent again."""
        failed = False
        while self._parts.controller.may_have_to_stop:
            try:
                await self._stop_fingers_once()
                return
            except RobotiqConnectionError as error:
                if not failed:
                    self._parts.options.log.warning("the stop was not delivered, trying again: %s", error)
                failed = True
                self._lose(error)
            await asyncio.sleep(STOP_PAUSE_S)

    async def _stop_fingers_once(self) -> None:
        if not self._parts.link.is_open:
            # It may have been lost since the last exchange: a grip may have ended meanwhile.
            self._lose(self.link_error())
            # A gripper without a client keeps moving. Read first: if it has lost its power, an image
            # with rACT would activate it, and another device may have its address.
            await self._open()
            await self._poller.read(is_first=True)
        assert self._ending is not None, "the fingers are stopped at the end"
        self._parts.controller.stop_fingers(self._ending.level)
        while True:
            await self._poller.cycle()
            if self._parts.publisher.has_to_tell:
                self._parts.publisher.tell()  # if nothing had to be written in it
            if not self._parts.controller.is_busy:
                return
            await asyncio.sleep(self._parts.options.poll_interval)
