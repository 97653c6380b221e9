"""Fault 0x09 in passing: some grippers show it once after a second without a message.

The 3-Finger's manual calls 0x09 "communication chip not ready (may be booting)". The two-finger and vacuum
grippers of the same family, whose older manuals use the same words, show it in the first read after a second
of silence and not again; this was seen on real ones. So 0x09 counts as a fault only when it lasts.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from ..values import registers as reg
from ..values.enums import Fault
from ..values.status import RobotiqStatus

LASTS_READS: Final = 3
"""Reads that must show it. A gripper shows it in one; a second read may see the same registers."""
LASTS_S: Final = 0.01
"""Seconds between the first and the last of these reads. A gripper renews its registers at 100 Hz or faster
(manual of 2014, Modbus TCP), so three reads over this time show it more than once. It must not be longer:
fingers that must stop move on meanwhile, a count or two at full speed."""
SILENCE_S: Final = 0.9
"""After this time without a read a gripper may show it again, and the count begins anew. One second is what
is known."""

_CODE: Final = int(Fault.COMMUNICATION_NOT_READY)


class PassingFault:
    """Distinguishes 0x09 that lasts from 0x09 that follows a silence.

    Attributes:
        is_shown: whether the newest status shows it, and it has not lasted.
        is_open: whether the next reads decide. Never on a link so slow that each read ends a silence.
        reads: reads in a row that have shown it; at 0 a status without it need not be seen.
    """

    def __init__(self, passed: Callable[[], None] = lambda: None) -> None:
        self.is_shown = False
        self.is_open = False
        self.reads = 0
        self._passed = passed
        """Called each time 0x09 has gone without having lasted."""
        self._since = math.inf
        self._asked = -math.inf
        self._first = math.inf
        self._in_a_row = 0

    def see(self, status: RobotiqStatus, asked: float) -> RobotiqStatus:
        """Return the status to judge by: without the fault until that has lasted."""
        last, self._asked = self._asked, asked
        if reg.gFLT.read(status.registers) != _CODE:
            if self.reads:
                self._end()
                self._in_a_row = 0
            return status
        if not self._in_a_row:
            self._first = asked
        self._in_a_row += 1
        if asked - last > SILENCE_S and self.reads:
            self._end()
        if not self.reads:
            self._since = asked
        self.reads += 1
        self.is_shown = self.reads < LASTS_READS or asked - self._since < LASTS_S
        self.is_open = self._in_a_row < LASTS_READS or asked - self._first < LASTS_S
        return without_fault(status) if self.is_shown else status

    def _end(self) -> None:
        was_shown, self.is_shown, self.reads, self.is_open = self.is_shown, False, 0, False
        if was_shown:
            self._passed()


def without_fault(status: RobotiqStatus) -> RobotiqStatus:
    """The same status, with gFLT = 0."""
    words = list(status.registers)
    reg.gFLT.write(words, 0)
    return RobotiqStatus(tuple(words), status.timestamp, status.sequence, status.model)
