"""Dialogues with a gripper over Modbus: one generator for each thing that a hand wants of its link.

A dialogue yields steps (line.py) and gets the answer to each. It returns a status, or whether it has written.
Where it raises, it gives the line up, and the next one begins with an opening. No I/O and no event loop: a
line carries it out, and a test can, too.

* **A read is repeated** where its answer can be missing or damaged without harm. The second answer
  must not be the first one that was only late: so first silence, then a read of another length. If the first
  answer arrives now, it has the wrong length and ends the connection. Only then the status is read.
* **A write is never repeated.** Whether it was carried out is unknown, and the status that is read next
  tells.
* **Function 23 is tried without a command.** A jaw answers no function that it does not serve. So until it
  has answered this one, a command leaves with function 16, and the status is read after it. Before a command
  that finds the jaw at rest, as this link has requested it, function 23 writes that image again; before the
  first command, the image that an adopted jaw shows. Nothing moves by it, and a silence costs a read and no
  command.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Sequence
from itertools import cycle
from typing import Final

from ..runtime.logger import Log
from ..values.registers import REGISTER_COUNT, RegisterMap, Registers
from . import transport
from .exchange import HUSH, READY, TURN, Dialogue, Exchange, Timing
from .frames import read_request, registers_in, write_and_read_request, write_request
from .in_force import image_in_force, shows
from .line import Line
from .outcome import PASSING, UNKNOWN_FUNCTION, Answer, Noise, Outcome, Refused, Silent, check
from .serial.patience import USUAL_RESPONSE_S

REPEAT_S: Final = 0.15
"""Time for a repeated read, so that a write after it still fails within a second. On a slow line, which has a
longer response timeout than the usual one, it gets that timeout."""
SHORT_READS: Final = 3
"""Reads after the short silence, at opening, before a line is trusted with it."""
MOST_UNANSWERED: Final = 3
UNANSWERED_S: Final = 60.0
"""With so many unanswered reads in so many seconds, a line gets the longer silence."""
MOST_OUTSTANDING: Final = 64
"""Requests in a row whose answers may come late: half a minute of them."""
REPEAT_WARNING_S: Final = 60.0
"""At most one warning about repeated reads in this time."""

Decide = Callable[[], Sequence[int] | None]
"""Returns the image to write, or None; called in the turn of the loop in which a write leaves."""
MakeExchange = Callable[[bytes, Timing], Exchange]
"""Makes the exchange of a request (unit and PDU) in the form of a line."""


class Dialogues:
    """The dialogues with one gripper, over all connections to it.

    Attributes:
        line: the line to it.
        repeats: number of reads repeated because an answer was missing or damaged.
        serves_23: whether the gripper serves function 23; None while it has not shown that.
    """

    def __init__(
        self, line: Line, registers: RegisterMap, make: MakeExchange, response_timeout: float, log: Log
    ) -> None:
        self.line: Line = line
        self.repeats: int = 0
        self.serves_23: bool | None = None if registers.write_function == 23 else False
        self._map: Final = registers
        self._make: Final = make
        self._usual: Final = Timing(response_timeout)
        self._whole: Final = self._usual._replace(is_whole=True)
        """For a write whose outcome no status shows: a late acknowledgement would cost the link, and a stop
        that has arrived would count as lost."""
        self._repeat_s: Final = response_timeout if response_timeout > USUAL_RESPONSE_S else REPEAT_S
        self._log: Final = log
        self._poll: Final = read_request(registers, registers.count)
        self._rest: Registers | None = None if registers.count < REGISTER_COUNT else ()
        """The registers after those that a poll reads, as the first probe found them; None before it."""
        self._probes: Final = cycle(range(1, registers.count))
        """The numbers of registers of the reads that bring the line in step, each another one."""
        self._outstanding: Final[deque[bytes]] = deque(maxlen=MOST_OUTSTANDING)
        """Requests whose answers may still come, in order."""
        self._unanswered: Final = deque((-math.inf,) * MOST_UNANSWERED, MOST_UNANSWERED)
        """The times of the last reads that were repeated because there was no answer."""
        self._image: Sequence[int] | None = None
        """The last image that was acknowledged; empty after one that was not, None before the first."""
        self._status: Registers = ()
        """The newest status."""
        self._warned = -math.inf
        """The time of the last warning about a repeated read."""

    def move_to(self, line: Line) -> None:
        """Another line leads to the gripper, before an opening."""
        self.line = line

    # -- dialogues ---------------------------------------------------------------------------------------

    def opening(self) -> Dialogue[None]:
        """Make sure that no answer to an earlier request is taken for one to come.

        The first exchange is made twice if it fails harmlessly: the tool port of some arms loses the first
        request of a connection, so do some gateways over TCP, and ``socat`` with ``waitslave`` connects only
        when it sees one. Over TCP an answer that is only late gives itself away by its transaction id. A
        device with three registers may refuse the read of eight, or not answer it.
        """
        asks_for_rest = self._rest is None
        first = yield from self._probed()
        if isinstance(first, Outcome):
            is_harmless = isinstance(first, Silent) or (asks_for_rest and isinstance(first, Refused))
            if not (is_harmless or self._can_repeat(first)):
                raise first.error
            yield TURN
            if isinstance(again := (yield from self._in_step(self._repeated())), Outcome):
                raise first.error from again.error
            if asks_for_rest:
                what = "%s did not answer a read of all registers: %s"
                self._log.info(what, self.line.address, first.error)
        yield from self._try_short_silence()

    def read(self) -> Dialogue[Registers]:
        """Read the status."""
        came_to = yield self._ask(self._poll)
        if isinstance(came_to, Outcome):
            came_to = yield from self._again(came_to)
        return self._status_in(came_to)

    def write(self, decide: Decide) -> Dialogue[bool]:
        """Write the image that ``decide`` returns, with function 16; return whether there was one."""
        yield from self._ready()
        return (yield from self._written_whole(decide))

    def write_and_read(self, decide: Decide) -> Dialogue[transport.WriteAnswer | None]:
        """Write the image that ``decide`` returns, and read the status; None if nothing new was written.

        A missing or damaged reply leaves the write in doubt; the status that is read shows whether it was
        carried out.

        A device that refuses function 23, or does not answer it at first, gets function 16 from then on. A
        refusal of the function means that nothing was carried out. So the dialogue calls ``decide`` again,
        because a stop may have come since, and writes with function 16 at once. A trial of function 23 calls
        no ``decide``: the status on which it would decide is too old.
        """
        yield from self._ready()
        uses_23 = self._map.is_sure if self.serves_23 is None else self.serves_23
        if self.serves_23 is None and not uses_23 and (known := image_in_force(self._status, self._image)):
            came_to = yield from self._written(known, self._usual, reads=True)
            if isinstance(came_to, Outcome) and not isinstance(came_to, Refused):
                yield from self._again(came_to)
            return None
        if (image := decide()) is None:
            return None
        # A status that follows tells nothing if it had that echo before.
        is_shown = self.line.is_shared and self._status and shows(self._status, image)
        came_to = yield from self._written(image, self._whole if is_shown else self._usual, reads=uses_23)
        if isinstance(came_to, bytes):
            status = self._status_in(came_to) if uses_23 else (yield from self.read())
            return transport.WriteAnswer(status, None)
        if uses_23 and isinstance(came_to, Refused) and came_to.code == UNKNOWN_FUNCTION:
            if not (yield from self.write(decide)):
                return None
            yield TURN
            return transport.WriteAnswer((yield from self.read()), None)
        status = self._status_in((yield from self._again(came_to, was_write=True)))
        return transport.WriteAnswer(status, came_to.error)

    def stop_or_read(self, decide: Decide) -> Dialogue[Registers | None]:
        """When the turn has come, call ``decide`` and write its image; without an image, read the status.

        After a disturbance it reads: a read brings the line in step, so that the next write can leave.
        """
        if not isinstance((yield READY), Outcome) and (yield from self._written_whole(decide)):
            return None
        return (yield from self.read())

    # -- parts of them -------------------------------------------------------------------------------------

    def _ready(self) -> Dialogue[None]:
        """Make sure that a write leaves at once: it must not meet the rest of a disturbance."""
        obstacle = yield READY
        if isinstance(obstacle, Outcome) and self._can_repeat(obstacle):
            check((yield from self._in_step()))
            obstacle = yield READY  # once: some lines add a byte to every reply
        check(obstacle)

    def _written_whole(self, decide: Decide) -> Dialogue[bool]:
        """Write the image that ``decide`` returns; return whether there was one."""
        if (image := decide()) is not None:
            check((yield from self._written(image, self._whole)))
        return image is not None

    def _written(self, image: Sequence[int], timing: Timing, *, reads: bool = False) -> Dialogue[Answer]:
        """Write an image: with function 16, or with 23 if it also reads; learn whether that is served."""
        self._image = ()
        request = (write_and_read_request if reads else write_request)(self._map, image)
        came_to = yield self._ask(request, timing)
        if isinstance(came_to, bytes):
            self._outstanding.clear()
            self._image = image
            self.serves_23 = reads or self.serves_23
        elif reads and self.serves_23 is None and isinstance(came_to, Refused | Silent):
            self.serves_23 = False
            self._log.warning("%s is written with function 16: %s", self.line.address, came_to.error)
        elif isinstance(came_to, Silent) and not self.line.is_shared:
            # A stop that comes again must be heard. The trial at the next opening would cost another response
            # timeout, in which fingers move on. On a line that others use it takes a short question, and they
            # would pay for a gripper that is dead.
            self._keep_long_silence(came_to)
        return came_to

    def _again(self, first: Outcome, *, was_write: bool = False) -> Dialogue[bytes]:
        """Read again on a line that lost or damaged a byte, as USB adapters occasionally do.

        Where others use the line a question is short. A gripper is asked there until its time is over: the
        answer may come when nothing waits for it, and meet the next question as noise. A refused write does
        not prevent a read.

        Raises:
            RobotiqConnectionError: that of the first request, if there is again no clean answer.
        """
        if not (self._can_repeat(first) or (was_write and isinstance(first, Refused))):
            raise first.error
        until = self.line.now() + self._usual.seconds
        while True:
            yield TURN
            timing = self._repeated(is_long=True)  # the shorter silence may be why there was no answer
            came_to = yield from self._in_step(timing)
            if isinstance(came_to, bytes):
                came_to = yield self._ask(self._poll, timing)
            if isinstance(came_to, bytes):
                self._note_repeat(first)
                return came_to
            is_asked_again = isinstance(came_to, Silent | Noise) and self.line.is_shared
            if not is_asked_again or self.line.now() > until:
                raise first.error from came_to.error

    def _in_step(self, timing: Timing | None = None) -> Dialogue[Answer]:
        """Wait for silence, and drop the rest of a damaged reply; then make sure that nothing can come."""
        noise = yield HUSH
        return noise if isinstance(noise, Outcome) else (yield from self._probed(timing))

    def _probed(self, timing: Timing | None = None) -> Dialogue[Answer]:
        """Make sure that no answer to an earlier request is still on its way.

        Serial replies carry no transaction id, and a gateway from TCP to a serial line gives a late reply the
        id of the next request. So this reads fewer registers than a poll, another number each time. A late
        answer to a poll has another length. The gripper answers in order. The answer may be that to an
        earlier one of these reads with the same number: a jaw has two numbers only. So this reads on until
        no poll has left since the oldest read that the answer may belong to.

        The first one of all asks a jaw for eight registers, which show a wrong model.
        """
        while True:
            request = read_request(self._map, REGISTER_COUNT if self._rest is None else next(self._probes))
            came_to = yield self._ask(request, timing)
            if self._rest is None:
                self._rest = registers_in(came_to)[self._map.count :] if isinstance(came_to, bytes) else ()
            if isinstance(came_to, Outcome) or self._is_in_step_after(request):
                return came_to

    def _is_in_step_after(self, request: bytes) -> bool:
        """Whether no answer but those to probes can follow an answer to this probe."""
        outstanding, poll = self._outstanding, self._poll
        while outstanding and outstanding.popleft() != request:
            pass
        return all(each[1] == poll[1] and each != poll for each in outstanding)

    def _try_short_silence(self) -> Dialogue[None]:
        """Read a few times after 3.5 characters of silence; take the longer one if an answer is missing."""
        for _ in range(SHORT_READS if self.line.silence.is_short else 0):
            yield TURN  # one exchange for each: a slow gripper keeps others waiting
            came_to = yield from self._probed()
            if isinstance(came_to, Outcome):
                if not self._can_repeat(came_to):
                    raise came_to.error
                if not isinstance(came_to, Refused):
                    self._keep_long_silence(came_to)
                yield TURN
                check((yield from self._in_step()))
                break

    # -- requests, and the meaning of outcomes ---------------------------------------------------------------

    def _ask(self, request: bytes, timing: Timing | None = None) -> Exchange:
        self._outstanding.append(request)
        return self._make(request, timing or self._usual)

    def _can_repeat(self, outcome: Outcome) -> bool:
        """Whether a read can be asked again after this."""
        if isinstance(outcome, Refused):
            return outcome.code in PASSING
        return self.line.forgives and isinstance(outcome, Noise | Silent)

    def _repeated(self, *, is_long: bool = False) -> Timing:
        """The limits of all that a repeated read takes; where others use the line, of each question."""
        by = math.inf if self.line.is_shared else self.line.now() + self._repeat_s
        return self._usual._replace(by=by, is_long=is_long)

    def _status_in(self, answer: bytes) -> Registers:
        self._outstanding.clear()
        registers = registers_in(answer)
        self._status = registers[: self._map.count] + self._rest if self._rest else registers
        return self._status

    def _note_repeat(self, first: Outcome) -> None:
        self.repeats += 1
        now = self.line.now()
        if isinstance(first, Silent):
            self._unanswered.append(now)
            if now - self._unanswered[0] < UNANSWERED_S:
                self._keep_long_silence(first)
        if now - self._warned >= REPEAT_WARNING_S:
            self._warned = now
            self._log.warning("a read was repeated: %s (%d times so far)", first.error, self.repeats)

    def _keep_long_silence(self, why: Outcome) -> None:
        """Take the longer silence from here on, because a request after the shorter one had no answer."""
        silence = self.line.silence
        if silence.is_short:
            silence.lengthen()
            what = "%s does not answer after a silence of %.1f ms, so it gets 1.75 ms: %s"
            self._log.warning(what, self.line.address, 1000 * silence.short_s, why.error)
