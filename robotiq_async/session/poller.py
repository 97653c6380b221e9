"""The one task that owns the link: it connects, polls, writes, reconnects and shuts down.

Every cycle reads the status, decides and writes at once, like the scan of a PLC, so each decision is made on
what the gripper has just shown. What stops the gripper does not wait for the read. Nor does a command on a
slow link (a serial line, a URCap) while the newest status is fresh: a read takes as long there as the status
is old, and the read after the write shows the command's echo.

On a line that several grippers share, a poll waits for its turn. A stop that comes meanwhile takes that turn.

No other task touches the transport: callers leave their requests with the controller and wait. So no exchange
is cancelled in flight, except when a stop has waited for it long enough; then the link is closed with it.
start() and stop() may be called from different tasks.
"""

from __future__ import annotations

import asyncio
import contextlib
import importlib
import math
import sys
from time import strftime
from typing import Final

from ..control.controller import Controller, Due
from ..control.waiters import fail, resolve
from ..link.transport import CyclicLink, Link, SharedLink
from ..runtime.limit import HELD_S, Limit
from ..runtime.tick import Tick
from ..values.enums import StopLevel
from ..values.errors import (
    ConnectFailedError,
    ConnectionLostError,
    NotStartedError,
    ResponseTimeoutError,
    RobotiqConnectionError,
    RobotiqError,
    WrongModelError,
)
from ..values.events import SentRequest
from ..values.model import names_that_fit
from ..values.registers import Registers
from ..values.request import Request
from ..values.statistics import Counters
from ..values.status import RobotiqStatus
from .opening import Opener
from .options import LATE_POLLS, LONGEST_SPACING_S, HandOptions
from .streams import Channels

# anyio loads its backend at its first use, which would hold up the loop for some 20 ms when a hand starts.
# The name of the backend is not documented; if it changes, it only costs those 20 ms.
with contextlib.suppress(ImportError):
    importlib.import_module("anyio._backends._asyncio")

STOP_S: Final = 1.4
"""From stop() to the disconnection at the latest. stop() promises 2 s, and a transport object may take half a
second to close. Like every limit it counts while the loop runs: a stop is tried at least once."""
IN_FLIGHT_S: Final = 0.9
"""Of STOP_S: how long the exchange in flight may take before the link is closed and reopened."""
SHUTDOWN_PAUSE_S: Final = 0.05  # between two attempts at that
READS: Final = 3  # the most reads in a cycle that has a request to write, while the loop is held up
FRESH_S: Final = 0.006
"""On a slow link a command is decided on the newest status if that was asked for within this time: the poll
interval and a bit. A read of three registers takes half of it."""
SOON_S: Final = 0.0025
"""Longest wait of a cycle for write_spacing: half of a usual period, so that its status is still fresh."""
LATE_S: Final = 0.05
"""A poll that is later than this is worth a warning; on a busy machine a few milliseconds are usual."""
LATE_WARNING_S: Final = 60.0  # seconds between two warnings about late polls
HELD_UP: Final = "something holds up the event loop, or it was not running"
IN_IPYTHON: Final = " (as between the prompts of IPython's terminal: use robotiq_async.sync there)"


class Poller:
    """Runs the link of one hand from start to stop; :meth:`run` is the body of its task.

    No other task may use the transport.

    Attributes:
        connected: done after the first status; holds the error if there is none.
        failure: why the link was given up, if it was.
        why_lost: why the link is down, while it is being opened again.
    """

    def __init__(
        self,
        transport: Link,
        controller: Controller,
        counters: Counters,
        channels: Channels,
        options: HandOptions,
        *,
        wait: float = 0.0,
    ) -> None:
        self._wait = wait
        self._transport = transport
        self._cyclic = transport if isinstance(transport, CyclicLink) else None
        self._line = transport if isinstance(transport, SharedLink) else None
        self._controller = controller
        self._counters = counters
        self._channels = channels
        self._options = options
        self._model = options.model
        self._stroke = options.units.stroke
        self._has_current = options.link.has_current
        self._log = options.log
        self._loop = asyncio.get_running_loop()
        self.connected: asyncio.Future[None] = self._loop.create_future()
        self.failure: RobotiqConnectionError | None = None
        self.why_lost: RobotiqConnectionError | None = None
        self.lost_since = ""
        """The time of day at which the link went down, if it is down."""
        self._stopping = False
        self._in_flight = Limit()  # of the exchange in flight when a stop comes
        self._ending = Limit(shield=True)
        self._level = StopLevel.LEAVE
        """The strongest requested so far."""
        self._opener = Opener(self._connect, options)
        self._is_polling = False
        self._tick = Tick(options.poll_interval)
        self._last_poll = 0.0
        self._asked = -math.inf  # when the newest status was asked for
        self._warned = -math.inf
        self._late: list[float] = []
        """The seconds of each late poll since the last warning about them."""
        self._decided: tuple[Request, float] | None = None  # the last image decided on, and when

    def request_stop(self, *, halt: bool, keep_grip: bool = False) -> None:
        """End the task as a :class:`StopLevel` says; the strongest of several requests counts. Never blocks.

        From here on the controller refuses every request and has dropped those that were not sent.
        """
        level = StopLevel.of(halt=halt, keep_grip=keep_grip)
        if not self._stopping:
            # A halt, a reset or a hold that is not over is dropped with the rest: this stop must replace it.
            self._level = max(level, StopLevel.KEEP) if self._controller.has_open_stop else level
            self._ending.restart(STOP_S)
            if self._is_polling:
                self._in_flight.restart(IN_FLIGHT_S)
            self._refuse_requests()
        elif level > self._level:
            self._log.info("a stronger stop came: the fingers are %s", level.done)
            self._level = level
            self._ending.restart(STOP_S)
            if level is StopLevel.SHUTDOWN:
                self._controller.keep_no_grip()
        elif level < self._level:
            self._log.warning(self._level.prevails)
        self._opener.end()

    def _refuse_requests(self) -> None:
        """Take no more requests, and drop those that were not sent.

        This cannot wait for the end of the task: between the read and the write of this cycle it would still
        take a request and begin a motion.
        """
        self._stopping = True
        self._controller.refuse_requests()
        self._channels.publish_changes()

    def hurry(self) -> None:
        """Begin the next cycle at once, and not with the tick, if it may begin with a write."""
        due = self._controller.due(self._tick.time())
        if due is not None and (due.is_urgent or (self._options.link.is_slow and due.wait <= SOON_S)):
            self._tick.hurry()

    def abandon(self) -> None:
        """The loop was closed: release the shared timer."""
        self._tick.close()

    async def run(self) -> None:
        """Own the link until asked to stop, or until the policy gives up."""
        bug: Exception | None = None
        try:
            if await self._connect_first():
                self._is_polling = True
                with self._in_flight:
                    await self._poll()
                self._is_polling = False
                if self._in_flight.is_over:
                    self._controller.lost(
                        ResponseTimeoutError("no answer until the hand was stopped"), self._tick.time()
                    )
        except Exception as error:
            bug = error
            raise
        finally:
            # An abandoned task is ended when it is collected: the hand may have been started again by then.
            if not self._loop.is_closed():
                await self._finish()
                fail([self.connected], self._not_connected(bug))

    @staticmethod
    def _not_connected(bug: Exception | None) -> RobotiqError:
        """The error of callers that wait for the first status when the task ends."""
        if bug is not None:
            return ConnectionLostError(f"internal error: {bug!r}")
        return NotStartedError("the hand was stopped while it connected")

    # -- connecting ------------------------------------------------------------------------------------

    async def _connect_first(self) -> bool:
        try:
            connected = await self._opener.first(self._wait)
        except RobotiqConnectionError as error:
            if not self.connected.done():  # start() may have been cancelled
                self.connected.set_exception(error)
            return False
        if connected:
            resolve([self.connected])
            policy = self._options.policy
            # From here on the reconnect policy decides about activations.
            self._controller.activates = policy is not None and policy.activate
        return connected

    async def _connect(self) -> None:
        """Open the link and read the first status; read on while its fault 0x09 may be a passing one."""
        await self._open()
        self._last_poll = 0.0  # the time without a link counts as no period
        await self._poll_once(is_first=True)
        while self._controller.is_undecided:  # the silence before may show as a fault, once
            await asyncio.sleep(self._options.poll_interval)
            await self._poll_once()
        self._tick.start()
        self._counters.tick = self._tick.source

    async def _open(self) -> None:
        try:
            await self._transport.open()
        except RobotiqConnectionError:
            raise
        except Exception as error:
            if not self.connected.done():
                raise  # the first contact: a mistake of ours, or of a transport object
            # No thread, no memory, no descriptor: what the system lacks now it may have at the next try.
            self._log.debug("the link could not be opened", exc_info=error)
            raise ConnectFailedError(self._options.link.address, repr(error)) from error

    async def _reconnect(self, why: RobotiqConnectionError) -> bool:
        """Open the link again; False when that is given up, or when asked to stop."""
        self._log.warning("link lost: %s", why)
        self.lost_since = strftime("%H:%M:%S")
        self._note_why_lost(why)
        self._controller.lost(why, self._tick.time())
        self._channels.publish_changes()
        policy, since = self._options.policy, self._loop.time()
        if policy is None:
            self.failure = why
            return False
        try:
            connected = await self._opener.again(policy, self._note_why_lost)
        except RobotiqConnectionError as error:
            self.failure = error
            return False
        if connected:
            self.why_lost, self.lost_since = None, ""
            self._counters.reconnects += 1
            self._log.warning("link back after %.2f s", self._loop.time() - since)
        return connected

    def _note_why_lost(self, why: RobotiqConnectionError) -> None:
        """The newest reason counts: the first one is often the least telling."""
        self.why_lost = why
        self._controller.machine.why_down = f"{why} (down since {self.lost_since})"

    # -- polling ---------------------------------------------------------------------------------------

    async def _poll(self) -> None:
        while not self._stopping:
            passed = await self._wait_for_tick()
            if self._stopping:
                return
            try:
                await self._cycle()
                if not passed:
                    self._last_poll = 0.0  # a hurried cycle breaks the period
            except RobotiqConnectionError as error:
                if not await self._reconnect(error):
                    return

    async def _cycle(self) -> None:
        """Read, decide, write. Write a stop before reading, too: a gripper may execute it and not reply."""
        due = self._controller.due(self._tick.time())
        if due is not None and not self._is_held_up():
            if due.is_urgent and await self._is_soon(due, LONGEST_SPACING_S):
                await self._write()
            elif self._is_fresh_for(due) and await self._is_soon(due, SOON_S):
                # What is read shows the echo. A command that comes after it begins the next cycle.
                if not await self._write_and_read():
                    await self._poll_once()
                return
        for _ in range(READS):
            await self._stop_or_poll()
            due = self._controller.due(self._tick.time())
            if due is None or not await self._is_soon(due, SOON_S):
                return  # most cycles end here
            if not self._is_held_up():
                await self._write_and_read()
                return
        await self._write()

    def _is_fresh_for(self, due: Due) -> bool:
        """Whether it is a command for a slow link, and the newest status is new enough to decide on."""
        is_fresh = self._tick.time() + due.wait - self._asked <= FRESH_S
        return is_fresh and due.is_command and self._options.link.is_slow

    @staticmethod
    async def _is_soon(due: Due, soon: float) -> bool:
        """Whether the write may leave within ``soon`` seconds; waits until then."""
        if due.wait > soon:
            return False
        if due.wait:
            await asyncio.sleep(due.wait)
        return True

    async def _write_and_read(self) -> bool:
        """Write, and read in the same exchange if link and request allow that; whether a status was read."""
        link, due = self._cyclic, self._controller.due(self._tick.time())
        if link is None or not link.reads_with_writes or due is None or not due.is_command:
            await self._write()
            return False
        self._decided, self._tick.late = None, 0.0
        try:
            answer = await link.send_and_read(self._decide_or_repeat)
            if self._decided is None:
                return False
            answered = self._tick.time()
            request, decided = self._decided
            if answer is None:
                # Refused, and not repeated: what has been asked since replaces it, and is made from it.
                self._controller.acknowledged(answered)
                self._note_unacknowledged()
                return True
            status = self._status(answer.registers, answered)
            if answer.doubt is not None and not self._shows(status, request):
                await link.close()
                raise answer.doubt
        except RobotiqConnectionError:
            self._note_unacknowledged()
            raise
        self._counters.note_write(0.0, decided - self._asked)
        self._controller.acknowledged(decided)
        self._channels.requests.push(SentRequest(request, decided, acknowledged=True))
        self._take(status, decided)
        return True

    def _shows(self, status: RobotiqStatus, request: Request) -> bool:
        """Whether a status is the first with the echo of a request in doubt, which was carried out then."""
        newest = self._controller.status
        return status.echo == request.echo and newest is not None and newest.echo != request.echo

    def _note_unacknowledged(self) -> None:
        self._channels.publish_changes()
        if self._decided is not None:
            self._channels.requests.push(SentRequest(*self._decided, acknowledged=False))

    async def _write(self) -> None:
        self._decided = None
        # Listeners get the changes after the write: a request of theirs would come too late for this one.
        began = self._tick.time()
        try:
            is_written = await self._transport.send(self._decide)
        except RobotiqConnectionError:
            self._note_unacknowledged()
            raise
        if is_written:
            self._note_acknowledged(began)

    def _note_acknowledged(self, began: float) -> None:
        if self._decided is None:
            return
        answered = self._tick.time()
        self._counters.note_write(answered - began, self._decided[1] - self._asked)
        self._controller.acknowledged(answered)
        self._channels.publish_changes()
        self._channels.requests.push(SentRequest(*self._decided, acknowledged=True))

    def _decide(self) -> Registers | None:
        """The image to write, decided in the same turn as the write, so that no stop can intervene."""
        now = self._tick.time()
        request = self._controller.decide(now)
        if request is None:
            self._channels.publish_changes()  # no write follows to wait for
            return None
        self._counters.has_begun_to_write = True
        self._decided = request, now
        return request.registers

    def _decide_or_repeat(self) -> Registers | None:
        """The same; after a refusal once more what was refused, unless something has been asked since."""
        if self._decided is None:
            return self._decide()
        return None if self._stopping or self._controller.has_request else self._decided[0].registers

    def _decide_stop(self) -> Registers | None:
        """The image to write, if it is that of a stop."""
        due = self._controller.due(self._tick.time())
        is_stop = due is not None and due.is_urgent and not due.wait
        return self._decide() if is_stop and not self._is_held_up() else None

    async def _stop_or_poll(self) -> None:
        """Poll; before that write a stop that has come while others had the line."""
        if self._line is None or not self._line.is_shared:
            await self._poll_once()
            return
        self._decided, self._tick.late = None, 0.0
        asked = self._tick.time()
        try:
            registers = await self._line.stop_or_read(self._decide_stop)
        except RobotiqConnectionError:
            if self._decided is not None:
                self._note_unacknowledged()
            raise
        if registers is None:
            self._note_acknowledged(asked)
            await self._poll_once()
        else:
            self._take(self._status(registers, self._tick.time()), asked)

    async def _poll_once(self, *, is_first: bool = False) -> None:
        self._tick.late = 0.0
        asked = self._tick.time()
        registers = await self._transport.read()
        answered = self._tick.time()
        if is_first and (why := self._model.contradiction(registers)):
            raise WrongModelError(
                f"this is no {self._model.title}: its registers show {why}; {names_that_fit(registers)}"
            )
        self._take(self._status(registers, answered), asked)

    def _status(self, registers: Registers, answered: float) -> RobotiqStatus:
        number = next(self._channels.numbers)
        return RobotiqStatus(registers, answered, number, self._model, self._stroke, self._has_current)

    def _take(self, status: RobotiqStatus, asked: float) -> None:
        """Pass on a status that was asked for at ``asked``."""
        period = asked - self._last_poll if self._last_poll else None
        self._counters.note_poll(asked, status.timestamp, period)
        self._last_poll = self._asked = asked
        self._controller.see(status, asked)
        self._channels.publish_changes()
        self._channels.statuses.push(status)

    def _is_held_up(self) -> bool:
        """Whether the loop was held up since the newest status was asked for, or is at this moment.

        Such a status is too old to decide on: it may lack a write of another client, or the motion of an
        axis.
        A slow gripper does not count: then the ticks come in time.
        """
        tick = self._tick
        return tick.late > HELD_S or tick.time() - tick.due > HELD_S

    async def _wait_for_tick(self) -> int:
        """Wait for the next tick, and return how many have passed; a missed one is counted and skipped."""
        passed = await self._tick.wait()
        if not passed:
            self._last_poll = 0.0  # a hurried cycle breaks the period
            return passed
        self._counters.longest_stall = self._tick.longest_late
        if passed > 1:
            self._note_missed(passed - 1)
        return passed

    def _note_missed(self, missed: int) -> None:
        late = missed * self._tick.interval
        # A slow line outlasts the interval without a loop that was held up, and misses nothing.
        if late < LATE_S and self._options.link.is_slow and self._tick.late <= HELD_S:
            return
        self._counters.overruns += missed
        if late >= LATE_S:
            self._warn_late(late)

    def _warn_late(self, late: float) -> None:
        self._late.append(late)
        now = self._loop.time()
        if now - self._warned < LATE_WARNING_S:
            return
        self._warned = now
        why = "the gripper answers slowly" if self._tick.late < late / 2 else HELD_UP + _where()
        late_polls, self._late = self._late, []
        often = "" if len(late_polls) == 1 else f"{len(late_polls)} times, at most "
        by, missed = 1000 * max(late_polls), self._counters.overruns
        self._log.warning("%s, %s%.0f ms: %s (%d polls missed so far)", LATE_POLLS, often, by, why, missed)

    # -- the end ---------------------------------------------------------------------------------------

    async def _finish(self) -> None:
        """Stop the fingers if there is time, then disconnect."""
        if not self._stopping:
            # The link was given up, or the task was cancelled. A hand that has only looked leaves the fingers
            # to the client that moves them.
            has_written = self._counters.has_begun_to_write
            self.request_stop(halt=has_written, keep_grip=self._options.keep_grip)
        try:
            await self._end_motion_and_close()
        finally:
            if not self._loop.is_closed():
                self._tick.close()

    async def _end_motion_and_close(self) -> None:
        """Stop and close; again if a stronger stop is requested during this, or while the link closes."""
        done = StopLevel.LEAVE
        while True:
            try:
                while done < self._level:
                    done = self._level
                    await self._end_motion()
            finally:
                self._ending.stop()
                if not self._loop.is_closed():
                    await self._transport.close()
            if done == self._level:
                return

    async def _end_motion(self) -> None:
        if self._controller.status is None:
            return
        with self._ending:
            await self._stop_fingers()
        if self._ending.is_over:
            self._log.warning("the gripper did not confirm in time that the fingers were stopped")

    async def _stop_fingers(self) -> None:
        """Clear rGTO and see it, trying until the time is over. Unlike a motion, a stop may be sent again."""
        failed = False
        while True:
            try:
                await self._stop_fingers_once()
                return
            except RobotiqConnectionError as error:
                if not failed:
                    self._log.warning("the stop was not delivered, trying again: %s", error)
                failed = True
                self._controller.lost(error, self._tick.time())
                self._channels.publish_changes()
            await asyncio.sleep(SHUTDOWN_PAUSE_S)

    async def _stop_fingers_once(self) -> None:
        if not self._transport.is_open:
            # A gripper without a client keeps moving. Read first: if it has lost its power, an image
            # with rACT would activate it.
            await self._open()
            await self._poll_once()
        self._controller.stop_fingers(self._level)
        while True:
            await self._cycle()
            if not self._controller.is_busy:
                return
            await asyncio.sleep(self._options.poll_interval)


def _where() -> str:
    """A hint for those who type at IPython's prompt, empty for others."""
    ipython = sys.modules.get("IPython")
    return IN_IPYTHON if ipython is not None and ipython.get_ipython() is not None else ""
