"""Evidence: the condition that statuses show, without a fault that only passes.

Fault 0x09 may pass. The 3-Finger's manual calls it "communication chip not ready (may be booting)" (2012,
4.7). The two-finger and vacuum grippers of the same family, whose older manuals use the same words, show it
in the first read after a second of silence and not again [seen on real ones]. So 0x09 counts as a fault only
when it lasts.

A gripper may be found stranded: gACT = 1 with gIMC = 0 and no fault, its fingers at rest [seen: a 2F-85, in
the first status of a session; its user reset and activated it]. Only a rising rACT activates, so it stays
there for ever. A gripper that has just taken rACT over shows the same for a moment; so it counts when it
lasts.
"""

from __future__ import annotations

from functools import cache
from typing import Final

from ..runtime.logger import Log
from ..values import registers as reg
from ..values.enums import Fault, Initialization, Trigger
from ..values.model import Model
from ..values.status import RobotiqStatus

LASTS_READS: Final = 3
"""Reads that must show 0x09. A gripper shows it in one; a second read may see the same registers."""
LASTS_S: Final = 0.01
"""Seconds between the first and the last of these reads. A gripper renews its registers at 100 Hz or faster
[manual 2014, p. 75], so three reads over this time show it more than once. It must not be longer:
fingers that must stop keep moving in this time, a count or two at full speed."""
SILENCE_S: Final = 0.9
"""After this time without a read a gripper may show it again, and the count begins again. One second was
observed [seen]. A program that is stepped through in a debugger makes such silences."""
STRANDED_S: Final = 0.5
"""Seconds for which a gripper must show gACT = 1 with gIMC = 0 and the same positions to count as stranded.
No figure is published for how soon an activation shows; 0.2 s is the slowest device cycle considered."""
STRANDED_READS: Final = 10
"""The reads that this takes at least."""
FOLLOWS: Final = frozenset({Trigger.SEEN_READY, Trigger.SEEN_FAULT})
"""The conditions in which the gripper follows requests, ours or another client's."""

_CODE: Final = int(Fault.COMMUNICATION_NOT_READY)


def classify(status: RobotiqStatus) -> Trigger:
    """The condition that a status shows by itself, one of five."""
    # A serious fault comes first: gIMC = 0 with a fault is an automatic release and not a reset [manual 2014,
    # p. 50; 2018, p. 39]. Only gACT, gIMC and gFLT decide: they rarely change, so the result is cached.
    registers = status.registers
    return _classify(registers[0] >> 8, registers[1] >> 8 & 0x0F, status.model)


def is_activating(status: RobotiqStatus) -> bool:
    """Whether the gripper activates. A change of mode is busy as well, and keeps a held part."""
    return classify(status) is Trigger.SEEN_BUSY and status.initialization is Initialization.ACTIVATING


def is_interrupted(status: RobotiqStatus) -> bool:
    """Whether a fault shows in an activation: the fingers may continue when it clears [conceivable]."""
    # gIMC = 2 is a change of mode, which only an active gripper makes.
    is_begun = status.initialization in (Initialization.RESET, Initialization.ACTIVATING)
    return status.activation_echo and is_begun and classify(status) is Trigger.SEEN_FAULT


@cache
def _classify(activation: int, fault: int, model: Model) -> Trigger:
    # The byte with gACT and gIMC, and gFLT.
    status = RobotiqStatus((activation << 8, fault << 8, 0, 0, 0, 0, 0, 0), model=model)
    if status.fault is Fault.AUTOMATIC_RELEASE_DONE:
        return Trigger.SEEN_RELEASED
    if status.fault.is_serious:
        return Trigger.SEEN_FAULT
    if not status.activation_echo and status.initialization is Initialization.RESET:
        return Trigger.SEEN_RESET
    if status.activation_echo and status.is_activated:
        return Trigger.SEEN_READY
    return Trigger.SEEN_BUSY


class Spell(list[float]):
    """The times at which equal reads in a row were requested. What they show counts once it lasts."""

    def __init__(self, least: int, seconds: float) -> None:
        super().__init__()
        self._least: Final = least
        self._seconds: Final = seconds

    def add(self, asked: float) -> None:
        del self[self._least - 1 :]  # the first ones and the last say enough
        self.append(asked)

    @property
    def is_open(self) -> bool:
        """Whether it shows, and has not lasted yet."""
        return bool(self) and (len(self) < self._least or self[-1] - self[0] < self._seconds)


class Evidence:
    """The newest status as decisions see it: without a 0x09 that may pass."""

    def __init__(self, log: Log | None = None) -> None:
        self.status: RobotiqStatus | None = None
        self.condition: Trigger | None = None  # of the newest status; None while the link is down
        self.passed: int = 0  # how often 0x09 has gone without having lasted
        self._log: Final = log
        # The reads that have shown it: all, and those since the last silence. While "all" is open, the next
        # reads decide about it: not for long, even on a link so slow that each read ends a silence.
        self.passing: Final = Spell(LASTS_READS, LASTS_S)
        self._since_silence: Final = Spell(LASTS_READS, LASTS_S)
        # Those that have shown a stranded gripper, and its positions.
        self._stuck: Final = Spell(STRANDED_READS, STRANDED_S)
        self._stuck_at: tuple[int, ...] = ()

    @property
    def is_undecided(self) -> bool:
        """Whether the first statuses on a new link show 0x09, or a gripper that may be stranded."""
        return self.condition is None and (self.passing.is_open or self._stuck.is_open)

    def update(self, status: RobotiqStatus, asked: float) -> Trigger | None:
        """Take in a status; return its condition, or None while the first one on a new link is undecided."""
        condition = classify(status)
        # Nearly every poll ends here: the gripper was ready, is so, and has not shown 0x09.
        if condition is self.condition is Trigger.SEEN_READY and not self.passing:
            self.status = status
            return condition
        if self.passing or condition is Trigger.SEEN_FAULT:  # if not, 0x09 need not be looked for
            judged = self.judged(status, asked)
            # In a fault 0x09 is no news, and counts at once: hiding it would show the fault as cleared.
            status = status if self.condition is Trigger.SEEN_FAULT else judged
            condition = classify(status)
        if condition is Trigger.SEEN_BUSY and status.is_reset and status.fault is Fault.NONE:
            before, self._stuck_at = self._stuck_at, tuple(map(status.position, status.model.axes))
            if self._stuck_at != before:
                self._stuck.clear()
            self._stuck.add(asked)
            condition = condition if self._stuck.is_open else Trigger.SEEN_STRANDED
        else:
            self._stuck.clear()
        self.status = status
        if self.condition is not None or not self.is_undecided:
            self.condition = condition
        return self.condition

    def lost(self) -> None:
        self.condition = None  # the next one is the first
        self._stuck.clear()

    def judged(self, status: RobotiqStatus, asked: float) -> RobotiqStatus:
        """Return a status without 0x09 until 0x09 has lasted; the status was requested at ``asked``."""
        shows = reg.gFLT.read(status.registers) == _CODE
        if not shows or (self.passing and asked - self.passing[-1] > SILENCE_S):
            if self._since_silence.is_open:
                self.passed += 1
                if self.passed == 1 and self._log is not None:
                    self._log.info(
                        "the gripper showed fault 0x09 for a moment, as some do after a second without a "
                        "poll: ignored, and from here on only counted"
                    )
            self._since_silence.clear()
        if not shows:
            self.passing.clear()
            return status
        self.passing.add(asked)
        self._since_silence.add(asked)
        return without_fault(status) if self._since_silence.is_open else status


def without_fault(status: RobotiqStatus) -> RobotiqStatus:
    words = list(status.registers)
    reg.gFLT.write(words, 0)
    return RobotiqStatus(
        tuple(words), status.timestamp, status.sequence, status.model, status.stroke, status.has_current
    )
