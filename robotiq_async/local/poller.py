"""The cycles of a hand on its open link: cycle.py plans them, and here they are carried out.

On a line that several grippers share, a poll waits for its turn. A stop that comes meanwhile takes that turn.
"""

from __future__ import annotations

import asyncio
import math
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Final, NamedTuple

from ..control.controller import Controller, NextWrite
from ..control.entry import Entry
from ..hands.options import HandOptions
from ..hands.statistics import Counters
from ..link.transport import CyclicLink, Link, SharedLink
from ..runtime.limit import HELD_S
from ..runtime.tick import Tick
from ..values.contradictions import contradiction, names_that_fit, why_stranger, wrong_axes
from ..values.errors import ProtocolError, RobotiqConnectionError, WrongModelError
from ..values.events import SentRequest
from ..values.registers import Registers
from ..values.request import Request
from ..values.status import RobotiqStatus
from .cycle import READ, WAIT, WRITE, WRITE_AND_READ, CycleStep, begins_at_once, next_step
from .late_polls import LATE_S, LatePolls
from .publisher import Publisher


class RunParts(NamedTuple):
    """The parts of a run, which its poller uses too."""

    link: Link
    controller: Controller
    counters: Counters
    publisher: Publisher
    options: HandOptions


class Poller:
    """Makes the cycles, and passes on the statuses and images that they read and write.

    Attributes:
        tick: the tick of the cycles.
    """

    def __init__(self, parts: RunParts) -> None:
        link, self._controller, self._counters, self._publisher, options = parts
        self._link: Final = link
        self._cyclic: Final = link if isinstance(link, CyclicLink) else None
        self._is_slow: Final = options.link.is_slow
        # A line that is not slow is nobody else's.
        self._line: Final = link if self._is_slow and isinstance(link, SharedLink) else None
        self._model: Final = options.model
        self._stroke: Final = options.units.stroke
        self.tick: Final = Tick(options.poll_interval)
        self._log: Final = options.log
        self._accepted: str | None = None
        """The contradiction that the gripper showed when its link was opened last; None before the first."""
        self._late_polls: Final = LatePolls(self.tick.time, options.log)
        self._last_poll: float | None = None  # when the poll before began; None: no period is counted
        self._asked = -math.inf  # when the newest status was requested

    def break_period(self) -> None:
        """Do not count the time from the last poll to the next as a period."""
        self._last_poll = None

    def start_ticking(self) -> None:
        self.tick.start()
        self._counters.note_tick(self.tick.source)

    def hurry(self) -> NextWrite | None:
        """Begin the next cycle at once, and not with the tick, if it may begin with a write; return that."""
        write = self._controller.next_write(self.tick.time())
        if write is not None and begins_at_once(write, is_slow=self._is_slow):
            self.tick.hurry()
        return write

    def delay_of(self, write: NextWrite) -> float:
        """Seconds until a write leaves, if the link answers as it did at the last poll."""
        tick, status = self.tick, self._controller.status
        if tick.is_awaited:
            at_once = begins_at_once(write, is_slow=self._is_slow)
            return write.wait if at_once else max(write.wait, tick.due - tick.time())
        # An exchange is in flight. The last one is no measure for it if the loop was held up in that one.
        if status is None or tick.held_up_at > self._asked:
            return write.wait
        return write.wait + status.timestamp - self._asked

    def note_ticks(self, passed: int) -> bool:
        """Count the missed ticks of a wait in which ``passed`` came; False if none came: it was hurried."""
        if not passed:
            self.break_period()
            return False
        if self.tick.longest_late > self._counters.longest_stall:
            self._counters.note_stall(self.tick.longest_late)
        if passed > 1:
            self._note_missed(passed - 1)
        return True

    def _note_missed(self, missed: int) -> None:
        late, held_up = missed * self.tick.interval, self.tick.late
        # A slow line outlasts the interval without a loop that was held up, and misses nothing.
        if late < LATE_S and self._is_slow and held_up <= HELD_S:
            return
        self._counters.note_missed(missed)
        if late >= LATE_S:
            self._late_polls.note(late, held_up, self._counters.overruns)

    # -- a cycle ---------------------------------------------------------------------------------------

    async def cycle(self) -> None:
        """Read, decide and write, in the order that cycle.py has for it."""
        reads, step = 0, READ
        while True:
            write = self._controller.next_write(self.tick.time())
            if write is None or step is WRITE:
                if reads:
                    return  # most cycles end here
                step = READ
            elif (planned := self._plan(write, reads)) is None:
                return
            elif planned is WRITE_AND_READ:
                if not await self._write_and_read(write) and not reads:
                    await self.read()  # for the echo; a later command begins the next cycle
                return
            elif (step := planned) is WAIT:
                await asyncio.sleep(write.wait)
                continue
            if step is READ:
                line = self._line
                await (self._stop_or_read(line) if line is not None and line.is_shared else self.read())
                reads += 1
            else:
                await self._write()
                if reads:
                    return

    def _plan(self, write: NextWrite, reads: int) -> CycleStep | None:
        if not reads and not begins_at_once(write, is_slow=self._is_slow):
            return READ  # as next_step() says after more work: a stream of commands comes here at each poll
        age = self.tick.time() - self._asked
        return next_step(write, reads, age, is_stale=self._is_stale(), is_slow=self._is_slow)

    def _is_stale(self) -> bool:
        """Whether the loop was held up since the newest status was requested, or is at this moment.

        Such a status is too old to decide on: it may lack a write of another client, or the motion of an
        axis. A slow gripper does not count: then the ticks come in time.
        """
        tick = self.tick
        return tick.held_up_at > self._asked or tick.time() - tick.due > HELD_S

    # -- a write ---------------------------------------------------------------------------------------

    async def _write(self) -> None:
        began = self.tick.time()
        with self._noting_doubt():
            if await self._link.send(self._decide):
                self._note_acknowledged(began)

    async def _write_and_read(self, write: NextWrite) -> bool:
        """Write, and read in the same exchange if link and request allow that; whether a status was read."""
        link = self._cyclic
        if link is None or not link.reads_with_writes or not write.is_command:
            await self._write()
            return False
        has_decided = False

        def decide() -> Registers | None:
            nonlocal has_decided
            has_decided = True
            return self._decide_or_repeat()

        with self._noting_doubt():
            answer = await link.send_and_read(decide)
            entry = self._controller.in_flight
            if entry is None:
                if not has_decided:
                    self._controller.note_repeat(self.tick.time())
                return False
            answered = self.tick.time()
            if answer is None:
                # Refused, and not repeated: later requests replace it, and are made from it.
                self._controller.acknowledged(answered)
                self._note_sent(entry, acknowledged=False)
                return True
            status = self._status(answer.registers, answered)
            if answer.doubt is not None and not self._shows(status, entry.image):
                await link.close()
                raise answer.doubt
        self._counters.note_write(0.0, entry.sent - self._asked)
        self._controller.acknowledged(entry.sent)
        self._note_sent(entry, acknowledged=True)
        self._take(status, entry.sent)
        return True

    def _shows(self, status: RobotiqStatus, request: Request) -> bool:
        """Whether a status is the first with the echo of a request in doubt, which was carried out then."""
        newest = self._controller.status
        return status.echo == request.echo and newest is not None and newest.echo != request.echo

    @contextmanager
    def _noting_doubt(self) -> Iterator[None]:
        """Publish the sent request if the exchange fails: the gripper may carry it out, or never get it."""
        try:
            yield
        except RobotiqConnectionError:
            if (entry := self._controller.in_flight) is not None:
                self._note_sent(entry, acknowledged=False)
            raise

    def _note_acknowledged(self, began: float) -> None:
        entry, answered = self._controller.in_flight, self.tick.time()
        assert entry is not None, "an image has left"
        self._counters.note_write(answered - began, entry.sent - self._asked)
        self._controller.acknowledged(answered)
        self._note_sent(entry, acknowledged=True)

    def _note_sent(self, entry: Entry, *, acknowledged: bool) -> None:
        # Listeners get the changes after the write: their own requests would come too late for it.
        self._publisher.publish_request(SentRequest(entry.image, entry.sent, acknowledged=acknowledged))

    def _decide(self) -> Registers | None:
        """The image to write, decided in the same turn as the write, so that no stop can intervene."""
        request = self._controller.decide(self.tick.time())
        if request is None:
            self._publisher.publish_changes()  # no write follows to wait for
            return None
        self._counters.note_begun_to_write()
        self._publisher.image_leaves()
        return request.registers

    def _decide_or_repeat(self) -> Registers | None:
        """The same; after a refusal the refused image again, unless a newer request has come."""
        entry = self._controller.in_flight
        if entry is None:
            return self._decide()
        controller = self._controller
        return None if controller.is_off or controller.has_request else entry.image.registers

    def _decide_stop(self) -> Registers | None:
        """The image to write, if it belongs to a stop."""
        write = self._controller.next_write(self.tick.time())
        is_stop = write is not None and write.is_urgent and not write.wait
        return self._decide() if is_stop and not self._is_stale() else None

    # -- a status --------------------------------------------------------------------------------------

    async def _stop_or_read(self, line: SharedLink) -> None:
        """Read; before that write a stop that has come while others had the line."""
        asked = self.tick.time()
        with self._noting_doubt():
            registers = await line.stop_or_read(self._decide_stop)
        if registers is None:
            self._note_acknowledged(asked)
            await self.read()
        else:
            self._take(self._status(registers, self.tick.time()), asked)

    async def read(self, *, is_first: bool = False) -> None:
        """Read the status; who answers is settled by the first one on a link, before anything is written."""
        asked = self.tick.time()
        registers = await self._link.read()
        answered = self.tick.time()
        if is_first:
            await self._check_who_answers(registers)
        self._take(self._status(registers, answered), asked)

    async def _check_who_answers(self, registers: Registers) -> None:
        """Refuse another gripper, and a device that is no gripper.

        Reserved bits alone do not prove that this is another gripper than before. It may be in motion, so it
        must get its stop.
        """
        if shown := contradiction(self._model, registers):
            if self._accepted is None or wrong_axes(self._model, registers):
                await self._link.close()  # a stop would be written to a link that is open
                raise self._not_this_gripper(registers, shown)
            if shown != self._accepted:
                self._log.warning("the gripper shows %s; it showed none before", shown)
        self._accepted = shown

    def _not_this_gripper(self, registers: Registers, shown: str) -> ProtocolError:
        if why := why_stranger(registers):
            return ProtocolError(f"another device answers: {why}")
        what = f"this is no {self._model.title}: its registers show {shown}"
        return WrongModelError(f"{what}; {names_that_fit(registers)}")

    def _status(self, registers: Registers, answered: float) -> RobotiqStatus:
        number, has_current = next(self._publisher.numbers), self._link.has_current
        return RobotiqStatus(registers, answered, number, self._model, self._stroke, has_current)

    def _take(self, status: RobotiqStatus, asked: float) -> None:
        """Pass on a status whose poll began at ``asked``; its read may have left later."""
        period = None if self._last_poll is None else asked - self._last_poll
        self._counters.note_poll(asked, status.timestamp, period)
        self._last_poll = self._asked = asked  # no command is written right behind a repeated read
        self._controller.see(status, self._link.asked_at)
        self._publisher.publish_status(status)
