"""Fault 0x09 in passing: what a gripper shows once after a second without a message, and is fine.

The 3-Finger's manual calls 0x09 "communication chip not ready (may be booting)". The two-finger grippers and
the vacuum grippers of the same family, whose older manuals used the same words, show it in the first read
after a second of silence, and not again; on real ones that has been seen. So it is a fault when it lasts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from ..values import registers as reg
from ..values.enums import Fault
from ..values.status import RobotiqStatus

LASTS_READS: Final = 3
"""In so many reads it must be seen. It is shown in one; a second read may have met the same registers."""
LASTS_S: Final = 0.01
"""And for so long: the gripper renews its registers at 100 Hz at the slowest (manual of 2014, Modbus TCP), so
that what shows in three reads over that time has been said more than once. Not longer, for fingers that
must stop go on meanwhile: a count or two at full speed."""
SILENCE_S: Final = 0.9
"""After so long without a read it may be shown again: the count begins anew. A second is what is known."""

_CODE: Final = int(Fault.COMMUNICATION_NOT_READY)


class PassingFault:
    """Tells 0x09 that lasts from 0x09 that is shown after a silence."""

    def __init__(self, passed: Callable[[], None] = lambda: None) -> None:
        """Nothing has been read; ``passed`` is called each time it has passed without having lasted."""
        self.is_shown = False
        """Whether the newest status shows it, and it has not lasted."""
        self.is_open = False
        """Whether the next reads may tell more; never of a link so slow that each read ends a silence."""
        self._passed = passed
        self._since = math.inf
        self.reads = 0
        """Reads in a row that have shown it; while this is 0, a status without it need not be seen."""
        self._asked = -math.inf
        self._first = math.inf
        self._in_a_row = 0

    def see(self, status: RobotiqStatus, asked: float) -> RobotiqStatus:
        """The status as it is to be judged: without the fault as long as that has not lasted."""
        last, self._asked = self._asked, asked
        if reg.gFLT.read(status.registers) != _CODE:
            if self.reads:
                self._is_over()
                self._in_a_row = 0
            return status
        if not self._in_a_row:
            self._first = asked
        self._in_a_row += 1
        if asked - last > SILENCE_S and self.reads:
            self._is_over()
        if not self.reads:
            self._since = asked
        self.reads += 1
        self.is_shown = self.reads < LASTS_READS or asked - self._since < LASTS_S
        self.is_open = self._in_a_row < LASTS_READS or asked - self._first < LASTS_S
        return without_fault(status) if self.is_shown else status

    def _is_over(self) -> None:
        was_shown, self.is_shown, self.reads, self.is_open = self.is_shown, False, 0, False
        if was_shown:
            self._passed()


def without_fault(status: RobotiqStatus) -> RobotiqStatus:
    """The same status, with gFLT = 0."""
    words = list(status.registers)
    reg.gFLT.write(words, 0)
    return RobotiqStatus(tuple(words), status.timestamp, status.sequence)
