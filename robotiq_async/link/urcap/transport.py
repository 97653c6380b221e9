"""The link to a jaw behind Robotiq's URCap on a UR: the text port 63352.

To the rest of the library it is a link like the others: registers in, registers out (lines.py has the
translation). What the port makes different is decided here:

* A status takes a question for each variable. All of them leave in one write, so a status costs one round
  trip; it is not of one moment. A short read asks for PRE first, then for OBJ and POS, for one of the slow
  variables in turn (GTO, STA, FLT, ACT) and for the current. The echo of a request comes before the object
  status: an old OBJ beside a new echo would look like an arrival.
* Echo, activation and go belong together: a go that is newer than the echo beside it would look like the
  request of another client. So everything is read when a part of it changes, and after a write that changes
  activation or go until they show it; then PRE lies between two equal answers to ACT and GTO, and was true
  together with them. A new PRE that this link has written is no surprise: a stream of positions keeps
  the short read.
* Answers carry no number, but the name of the variable. After whatever is not all of the answers, in time,
  the connection is closed. A new connection begins with a silence, and with another question than the one
  that was open before: what a proxy delivers late is noticed by that.
* ``?`` for a value says that the controller cannot read its gripper. That is no fault of the connection,
  which stays: opening the link again asks on it.
* A write is one line and never repeated. Another client's SET shows in the echo, as it does over Modbus. The
  acknowledgement is the URCap's, and the line may be lost on its way to the gripper: where the echo stays as
  it was, the link is lost, and no other client is blamed.
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

from ...runtime.logger import Log, log
from ...values import registers as reg
from ...values.errors import ConnectFailedError, ConnectionLostError, ProtocolError, ResponseTimeoutError
from ...values.registers import Echo, Registers
from ..address import Address
from ..exchange import Dialogue, Exchange, Step, Timing
from ..line import Line
from ..outcome import Answer, Noise, Silent, check
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
LOST_S: Final = 0.4
"""A SET that does not show for so long is lost. Half a second after a write control blames another client."""

SHORT: Final = ("PRE", "OBJ", "POS")
"""The variables that change in a motion."""
ALL: Final = ("ACT", "GTO", "PRE", "ACT", "GTO", "OBJ", "STA", "FLT", "POS")
"""Everything; activation and go before and after the echo."""
CURRENT: Final = "COU"
"""The answer of a port that does not know it is not known; perhaps none. So it is asked alone at first."""


class Questions(Exchange):
    """Questions for variables, in one write.

    Attributes:
        names: the variables.
        values: those that were answered so far, in this order.
    """

    def __init__(self, names: Sequence[str], timing: Timing) -> None:
        super().__init__(b"".join(map(lines.question, names)), timing)
        self.names = names
        self.values: list[int | str] = []

    @property
    def unanswered(self) -> str:
        """The first variable without an answer; empty if each has one."""
        return self.names[len(self.values)] if len(self.values) < len(self.names) else ""

    def _verdict(self, received: bytes) -> Answer | None:
        self._received = lines.without_ends(received)  # without answers: below they are taken off
        try:
            while name := self.unanswered:
                end = self._received.find(b"\n") + 1 or len(self._received)
                value = lines.value_in(self._received[:end], name)
                if value is None:
                    return None
                self.values.append(value)
                self._received = lines.without_ends(self._received[end:])
        except ProtocolError as error:
            return Noise(error)
        return lines.stray(self._received) or b""

    def late(self, place: object, seconds: float) -> Silent:
        return _late(place, self._received, f"GET {self.unanswered}", seconds)


class UrcapSetting(Exchange):
    """A line that sets variables."""

    def _verdict(self, received: bytes) -> Answer | None:
        try:
            return received if lines.is_acknowledged(received) else None
        except ProtocolError as error:
            return Noise(error)

    def late(self, place: object, seconds: float) -> Silent:
        return _late(place, self._received, self.frame.decode().strip(), seconds)


def _late(place: object, received: bytes, question: str, seconds: float) -> Silent:
    half = lines.without_ends(received)
    what = f"half a line, {lines.show(half)}, answers" if half else "no answer to"
    return Silent(ResponseTimeoutError(f"{place}: {what} {question} within {seconds:g} s"))


class UrcapTransport:
    """A jaw behind the text port of Robotiq's URCap.

    Attributes:
        has_current: whether the port knows the motor current, as the openings have found.
    """

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
        self.has_current: bool = False
        self._log: Final = log
        self._address: Final = address
        self._gripper: Final = gripper
        self._connect_timeout: Final = connect_timeout
        self._timing: Final = Timing(response_timeout)
        self._line: Final = Line(address, stray=lines.stray)
        self._unanswered = ""
        """The first question that has no answer; that of a connection that has ended, too."""
        self._unreadable = ""
        """The variable that the controller could not read the last time; empty if it could read all."""
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
        self._lost_by = math.inf
        """Until when the oldest SET that was acknowledged and does not show yet must show."""

    @property
    def is_open(self) -> bool:
        return self in self._line.users

    @property
    def asked_at(self) -> float:
        return self._line.asked_at

    async def open(self) -> None:
        """Connect, and make sure that no answer to an earlier question is taken for one to come.

        Raises:
            ConnectFailedError: refused or unreachable, or the URCap does not choose the gripper.
            ProtocolError: the answer is none, or bytes arrive without a question.
            ConnectionLostError: the connection was closed at once, or the controller cannot read its gripper.
            ResponseTimeoutError: the connection is open, but no answer comes.
        """
        if not (self._unreadable and self.is_open):
            await self.close()
            await self._line.open(self, self._connect_timeout, self._log)
        self._changes, self._lost_by = True, math.inf  # what was written last may still show
        self._values.clear()
        if not await self._line.talk(self, self._opening()):
            raise self._cannot_be_read()

    async def read(self) -> Registers:
        """The status registers of a jaw.

        Raises:
            ConnectionLostError: the controller cannot read its gripper; the transport may be open.
            RobotiqConnectionError: no clean answer in time; the transport is closed.
        """
        registers = await self._line.talk(self, self._reading())
        if registers is None:
            raise self._cannot_be_read()
        return registers

    def send(self, decide: Callable[[], Sequence[int] | None]) -> Coroutine[Any, Any, bool]:
        """Write what ``decide`` returns, if anything, with one SET, exactly once.

        Raises:
            RobotiqConnectionError: no clean acknowledgement in time; the transport is closed.
        """
        return self._line.talk(self, self._writing(decide))

    async def close(self) -> None:
        """Disconnect; does nothing when closed."""
        self._line.leave(self)

    def _cannot_be_read(self) -> ConnectionLostError:
        why = "an emergency stop of the arm, or its tool has no power"
        what = f"the gripper cannot be read ({self._unreadable} ?): {why}"
        return ConnectionLostError(f"{self._address}: {what}")

    # -- dialogues ---------------------------------------------------------------------------------------

    def _opening(self) -> Dialogue[bool]:
        """Make the first exchanges; return whether the gripper can be read."""
        last_unanswered = self._unanswered
        if (yield from self._read("FLT" if last_unanswered == "STA" else "STA")) is None:
            return False
        if self._gripper is not None:
            outcome = yield UrcapSetting(lines.choice(self._gripper), self._timing)
            if isinstance(outcome, Noise | Silent):
                why = f"the URCap does not choose gripper {self._gripper}: {outcome.error}"
                raise ConnectFailedError(str(self._address), why) from outcome.error
            check(outcome)
        question = Questions([CURRENT], self._timing)
        outcome = yield question
        if isinstance(outcome, Noise | Silent):
            yield Step.HUSH
            # One answer may be lost. A port that knew the current still does, unless a status ended on it.
            self.has_current = self.has_current and last_unanswered != CURRENT
        else:
            self.has_current = isinstance(outcome, bytes) and question.values != [lines.UNREADABLE]
        return True

    def _reading(self) -> Dialogue[Registers | None]:
        """Read a status; None if the gripper cannot be read."""
        by = self._line.now() + self._timing.seconds
        current = (CURRENT,) if self.has_current else ()
        if not self._changes:
            slow = SLOW[self._turn]
            self._turn = (self._turn + 1) % len(SLOW)
            before, echo = self._values[slow], self._values["PRE"]
            if (yield from self._read(*SHORT, slow, *current, by=by)) is None:
                return None
            is_surprise = self._values["PRE"] != echo and self._shown not in self._sent
            self._changes = is_surprise or self._values[slow] != before
        if self._changes and not (yield from self._read_all(current, by)):
            return None
        activation, go, position = self._echo()
        return lines.status_registers(self._values | {"ACT": activation, "GTO": go, "PRE": position})

    def _writing(self, decide: Callable[[], Sequence[int] | None]) -> Dialogue[bool]:
        """Write what is decided; return whether there was anything."""
        check((yield Step.READY))
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
        check((yield UrcapSetting(lines.command(image, shown), self._timing)))
        self._lost_by = min(self._lost_by, self._line.now() + LOST_S)
        return True

    # -- a status ----------------------------------------------------------------------------------------

    def _read_all(self, current: tuple[str, ...], by: float) -> Dialogue[bool]:
        """Read every variable; activation, go and echo as they were in one moment."""
        for _ in range(TRIES):
            answers = yield from self._read(*ALL, *current, by=by)
            if answers is None:
                return False
            if answers[:2] == answers[3:5]:
                break
        else:
            raise ProtocolError(f"{self._address}: ACT and GTO change too often to be read")
        if self._shown == self._written or self._line.asked_at >= self._shows_by:
            self._written = NOTHING
        self._changes = self._written is not NOTHING
        return True

    @property
    def _shown(self) -> Echo:
        """Activation, go and echo as they were read."""
        return self._values["ACT"], self._values["GTO"], self._values["PRE"]

    def _echo(self) -> Echo:
        """The echo as it was read, or that of the image before if a command is taken half.

        Raises:
            ConnectionLostError: it does not show what was acknowledged, and nothing else either.
        """
        # By the time at which it was asked for: a loop that was held up reads an old answer late.
        shown, images, now = self._shown, (self._whole, *self._sent), self._line.asked_at
        if shown not in images and now < self._shows_by:
            for before, after in pairwise(images):
                if shown == lines.midway(before, after):
                    return before
        if shown not in self._sent and shown == self._whole and now >= self._lost_by:
            what = f"a SET was acknowledged, and its gripper has not shown it within {LOST_S:g} s"
            raise ConnectionLostError(f"{self._address}: {what}")
        if shown in self._sent:
            while self._sent.popleft() != shown:
                pass  # what was written before the image that shows will not show any more
            self._lost_by = now + LOST_S if self._sent else math.inf
        elif shown != self._whole:
            self._lost_by = math.inf  # another client's: control judges
        self._whole = shown
        return shown

    # -- questions ---------------------------------------------------------------------------------------

    def _read(self, *names: str, by: float = math.inf) -> Dialogue[list[int] | None]:
        """Read variables; None if the gripper cannot be read.

        Raises:
            RobotiqConnectionError: there are not all of the answers, in time.
        """
        questions = Questions(names, self._timing._replace(by=by))
        self._unanswered = names[0]
        outcome = yield questions
        self._unanswered = questions.unanswered
        check(outcome)
        found = zip(names, questions.values, strict=True)  # ACT and GTO twice, and readable once perhaps
        self._unreadable = next((name for name, value in found if value == lines.UNREADABLE), "")
        if self._unreadable:
            return None
        values = [int(value) for value in questions.values]
        self._values.update(zip(names, values, strict=True))
        return values
