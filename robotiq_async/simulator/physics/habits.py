"""Habits: behaviour of grippers beside the manual, or that no source settles, each with a name."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Final

from robotiq_async.values.checks import check_flag, check_seconds

_FOREVER_S: Final = 1e9

QUICK_ACTIVATION: Final = 4.2
"""Seconds of an activation at full speed: the fingers close and open (thesis, table A1.1)."""
REAL_ACTIVATION: Final = 12.0
"""Seconds that a real activation takes, about: one driver reports 15, others wait for 25 and 30."""


@dataclass(frozen=True, slots=True)
class Habits:
    """Choices of one gripper that the manual leaves open or others saw it make. Times are simulated.

    Nothing of it has been measured on a 3-Finger by us. The defaults follow the manual, and where that is
    silent the source named here.

    Attributes:
        activation_time: seconds that an activation takes at least, from any position; half of them to close
            the fingers, half to open them.
        status_lag: seconds by which gDT and gSTA trail the rest of the status. The manual says that they are
            valid with the echo; the vendor's software for the two-finger grippers waits up to 0.2 s.
        silence_fault: after so many seconds without a message gFLT is 0x09 in the first status that is read,
            and in no other (siblings: 1 s). A write that comes first takes it away.
        write_spacing: a write that comes less than so many seconds after the last one that was kept is
            acknowledged and forgotten (manual 2014, pp. 58, 75: leave 10 ms between commands).
        echoes_limits: a request beyond a software limit is echoed as the limit. The manual says that it is
            replaced by the limit (2014, p. 45; 2018, p. 36); which of the two gPR has is open.
        lets_go_on_halt: clearing rGTO, or a fault, releases the part. The vendor's article on protective
            stops says that it stays held, the manual that fingers lock themselves; neither is measured.
        keeps_status_on_halt: with rGTO = 0 an axis in a contact or at its request keeps its gDT;
            otherwise gDT and gSTA are 0 then. The manual says that their 0 means nothing while gGTO = 0.
        opens_without_rics: clearing rICS is a mode change: it opens the fingers, rGTO or not, and drops the
            part. Otherwise the scissor alone goes to its mode, as soon as rGTO is set. No source settles it.
        answers_with_echo: the reply to function 23 reflects the request that came with it. The 2F's manual
            says that the gripper executes the command, and one cycle of motion, before it answers; the
            vendor's loop relies on that. Otherwise the reply has the state before, like a read soon after a
            write. No source covers a 3-Finger.
    """

    activation_time: float = QUICK_ACTIVATION
    status_lag: float = 0.0
    silence_fault: float = math.inf
    write_spacing: float = 0.0
    echoes_limits: bool = False
    lets_go_on_halt: bool = False
    keeps_status_on_halt: bool = True
    opens_without_rics: bool = True
    answers_with_echo: bool = True

    def __post_init__(self) -> None:
        """Check the values.

        Raises:
            TypeError: a time is not a number, or another one not a bool.
            ValueError: a time is negative.
        """
        for name in ("activation_time", "status_lag", "write_spacing"):
            check_seconds(name, getattr(self, name), 0, _FOREVER_S)
        if self.silence_fault != math.inf:
            check_seconds("silence_fault", self.silence_fault, 0, _FOREVER_S)
        for name in (
            "echoes_limits",
            "lets_go_on_halt",
            "keeps_status_on_halt",
            "opens_without_rics",
            "answers_with_echo",
        ):
            check_flag(name, getattr(self, name))
