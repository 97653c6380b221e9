"""The link to a jaw behind Robotiq's URCap on a UR: the text port 63352, one variable a question.

To the rest of the library it is a link like the others: registers in, registers out (lines.py has the
translation). What the port makes different is decided here:

* A status takes a question for each variable, so it is not of one moment. Each read asks for PRE first, then
  for OBJ and POS, and for one of the slow variables in turn (GTO, STA, FLT, ACT). The echo of a request comes
  before the object status: an old OBJ beside a new echo would look like an arrival.
* Echo, activation and go belong together: a go that is newer than the echo beside it would look like the
  request of another client. So everything is read when a part of it changes, and after a write that changes
  activation or go until they show it; then PRE lies between two equal answers to ACT and GTO, and was true
  together with them. A new PRE that this link has written is no surprise: a stream of positions keeps
  the short read.
* Answers carry no number. There is one question at a time, and after whatever is not the one whole answer, in
  time, the connection is closed. A new connection begins with a silence, and with another question than the
  one that was open before: what a proxy delivers late is noticed by that.
* A write is one line and never repeated. Another client's SET shows in the echo, as it does over Modbus.
* No source says whether a URCap takes the variables of a line at once. An echo that is half that of a line
  just written and half that of the image before is not another client's: until the rest shows, for half a
  second at most, the status has the echo of the image before. OBJ, STA, FLT and POS are as they were read.
* An activation that seemed to be lost may act later, whatever the gripper shows before: each image with
  rACT = 0 sets ACT (:func:`lines.command`).

Nothing of this has met a real controller.
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Callable, Coroutine, Sequence
from itertools import pairwise
from typing import Any, Final

from ...runtime.log import Log, log
from ...values import registers as reg
from ...values.errors import ConnectFailedError, ProtocolError, ResponseTimeoutError
from ...values.registers import Echo, Registers
from ..address import Address
from ..exchange import Answer, Exchange
from ..line import Dialogue, Line, Step
from ..outcome import Noise, Outcome, Silent
from . import lines

SHOWS_S: Final = 0.5
"""After a write everything is read for this long at most, until the echo shows it."""
SLOW: Final = ("GTO", "STA", "FLT", "ACT")
"""Asked for in turn, one in each read."""
LATEST: Final = 4
"""Written images that may still show as echo: a write or two in flight, in a fast stream."""
NOTHING: Final = (-1, -1, -1)
"""The echo of no image."""
TRIES: Final = 4
"""Of reading activation, go and echo of one moment. Both change at a stop or a start, not all the time."""


class _Question(Exchange):
    """A line and the check of its answer."""

    def __init__(self, line: bytes, read: Callable[[bytes], int | None]) -> None:
        super().__init__(line)
        self._read = read
        self.value = 0
        """What the whole answer says."""

    def feed(self, data: bytes) -> Answer | None:
        self._received += data
        try:
            said = self._read(self._received)
        except ProtocolError as error:
            return Noise(error)
        if said is None:
            return None
        self.value = said
        return self._received

    def late(self, place: object) -> Silent:
        half = lines.without_ends(self._received)
        what = f"half a line, {lines.show(half)}, answers" if half else "no answer to"
        asked = self.frame.decode().strip()
        return Silent(ResponseTimeoutError(f"{place}: {what} {asked} within {self.seconds:g} s"))


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
        self._line = Line(address, stray=lines.stray)
        self._asked = b""
        """The question that has no answer; that of a connection that has ended, too."""
        self._values: dict[str, int] = {}
        """The newest value of each variable on this connection."""
        self._turn = 0
        """Which of the slow variables comes next."""
        self._changes = True
        """Whether the next read asks for everything."""
        self._whole: Echo = NOTHING
        """The echo of the image that was last seen to be taken whole."""
        self._sent: deque[Echo] = deque(maxlen=LATEST)
        """The echoes of what was written since, also on a connection that was lost: they are expected."""
        self._releases = False
        """Whether the last write set ATR."""
        self._written: Echo = NOTHING
        """The echo of the last write, if it changes activation or go and does not show yet."""
        self._shows_by = -math.inf
        """Until when that is awaited."""

    @property
    def is_open(self) -> bool:
        return self._line.is_open_for(self)

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier question is taken for one to come.

        Raises:
            ConnectFailedError: refused or unreachable, or the URCap does not choose the gripper.
            ProtocolError: the answer is none, or bytes arrive without a question.
            ConnectionLostError: the connection was closed at once.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        await self.close()
        self._changes = True  # what was written last may still show
        self._values.clear()
        await self._line.open(self, self._connect_timeout)
        await self._line.talk(self, self._opening())

    def read(self) -> Coroutine[Any, Any, Registers]:
        """The status registers of a jaw; the variables were asked for one after the other.

        Raises:
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        return self._line.talk(self, self._reading())

    def send(self, decide: Callable[[], Sequence[int] | None]) -> Coroutine[Any, Any, bool]:
        """Write what ``decide`` returns, if anything, with one SET, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        return self._line.talk(self, self._writing(decide))

    async def write(self, registers: Sequence[int]) -> None:
        """Write the request registers."""
        await self.send(lambda: registers)

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._line.leave(self)

    # -- dialogues ---------------------------------------------------------------------------------------

    def _opening(self) -> Dialogue[None]:
        yield from self._get("FLT" if self._asked == lines.question("STA") else "STA")
        if self._gripper is not None:
            outcome = yield self._ask(lines.choice(self._gripper), _acknowledged)
            if isinstance(outcome, Noise | Silent):
                why = f"the URCap does not choose gripper {self._gripper}: {outcome.error}"
                raise ConnectFailedError(str(self._address), why) from outcome.error
            self._end(outcome)

    def _reading(self) -> Dialogue[Registers]:
        by = self._line.now() + self._response_timeout
        if not self._changes:
            yield from self._read_some(by)
        if self._changes:
            yield from self._read_all(by)
        activation, go, position = self._echo()
        return lines.status_registers(self._values | {"ACT": activation, "GTO": go, "PRE": position})

    def _writing(self, decide: Callable[[], Sequence[int] | None]) -> Dialogue[bool]:
        if isinstance(obstacle := (yield Step.READY), Outcome):
            raise obstacle.error
        if (image := decide()) is None:
            return False
        act, go, position = (field.read(image) for field in (reg.rACT, reg.rGTO, reg.rPR[0]))
        self._sent.append((act, go, position))
        # Before an image with rACT = 0 an activation may act that was thought lost: ACT is read again.
        if self._changes or not act or (act, go) != (self._values["ACT"], self._values["GTO"]):
            self._changes, self._shows_by = True, self._line.now() + SHOWS_S
            self._written = self._sent[-1]
        shown = None if self._releases else self._values.get("ACT")
        self._releases = bool(reg.rATR.read(image))
        self._end((yield self._ask(lines.command(image, shown), _acknowledged)))
        return True

    # -- a status ----------------------------------------------------------------------------------------

    def _read_some(self, by: float) -> Dialogue[None]:
        """The variables that change in a motion, and one of the slow ones."""
        if (yield from self._is_new("PRE", by)) and self._shown not in self._sent:
            self._changes = True
            return
        yield from self._is_new("OBJ", by)
        yield from self._is_new("POS", by)
        slow = SLOW[self._turn]
        self._turn = (self._turn + 1) % len(SLOW)
        self._changes = yield from self._is_new(slow, by)

    def _read_all(self, by: float) -> Dialogue[None]:
        """Every variable; activation, go and echo as they were in one moment."""
        yield from self._read_pair(by)
        for _ in range(TRIES):
            yield from self._is_new("PRE", by)
            if not (yield from self._read_pair(by)):
                break
        else:
            raise ProtocolError(f"{self._address}: ACT and GTO change too often to be read")
        for name in ("OBJ", "STA", "FLT", "POS"):
            yield from self._is_new(name, by)
        if self._shown == self._written or self._line.now() >= self._shows_by:
            self._written = NOTHING
        self._changes = self._written is not NOTHING

    @property
    def _shown(self) -> Echo:
        """Activation, go and echo as they were read."""
        return self._values["ACT"], self._values["GTO"], self._values["PRE"]

    def _echo(self) -> Echo:
        """The echo as it was read, or that of the image before if a command is taken half."""
        shown, images = self._shown, (self._whole, *self._sent)
        if shown not in images and self._line.now() < self._shows_by:
            for before, after in pairwise(images):
                if shown == lines.midway(before, after):
                    return before
        while shown in self._sent and self._sent.popleft() != shown:
            pass  # what was written before the image that shows will not show any more
        self._whole = shown
        return shown

    def _read_pair(self, by: float) -> Dialogue[bool]:
        """Read ACT and GTO; whether one of them has changed."""
        is_new = yield from self._is_new("ACT", by)
        return (yield from self._is_new("GTO", by)) or is_new

    def _is_new(self, name: str, by: float) -> Dialogue[bool]:
        """Read a variable; whether it has changed."""
        before = self._values.get(name)
        self._values[name] = yield from self._get(name, by)
        return self._values[name] != before

    # -- one question ------------------------------------------------------------------------------------

    def _get(self, name: str, by: float = math.inf) -> Dialogue[int]:
        question = self._ask(lines.question(name), lambda received: lines.value_in(received, name), by)
        self._end((yield question))
        return question.value

    def _ask(self, line: bytes, read: Callable[[bytes], int | None], by: float = math.inf) -> _Question:
        self._asked = line
        question = _Question(line, read)
        question.seconds, question.by = self._response_timeout, by
        return question

    def _end(self, came_to: Answer | None) -> None:
        """Note that the question was answered; every other outcome closes the connection."""
        if isinstance(came_to, Outcome):
            raise came_to.error
        self._asked = b""


def _acknowledged(received: bytes) -> int | None:
    return lines.is_acknowledged(received) or None
