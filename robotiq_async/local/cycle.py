"""The plan of a cycle: read, decide and write at once, like the scan of a PLC.

Pure: the next exchange follows from the pending write and from the age of the newest status. So each
decision is made on a status that the gripper has just shown.
"""

# Reads   To be written                           Newest status   Next
#
# 0       nothing                                 any             READ
#         anything                                stale           READ: it may lack a write of others
#         a stop, within LONGEST_SPACING_S        fresh           WRITE, and then READ
#         a command, slow link, within SOON_S     FRESH_S old     WRITE_AND_READ, the last
#         anything else                           fresh           READ
# 1..3    nothing, or not within SOON_S           any             none: the cycle is over
#         anything                                fresh           WRITE_AND_READ, the last
# 1, 2    anything                                stale           READ
# 3       anything                                stale           WRITE, the last
#
# Stale: the loop was held up since the status was requested, or is at this moment. A write that write_spacing
# keeps back is waited for (WAIT), and planned again: a stop may have come, or a block.
#
# A stop does not wait for the read: a gripper may carry it out and not answer. Nor does a command on a slow
# link (a serial line, a URCap) while the newest status is fresh: a read takes as long there as the status is
# old, and the read after the write shows the echo of the command.

from __future__ import annotations

from enum import Enum
from typing import Final

from ..control.controller import NextWrite
from ..hands.options import LONGEST_SPACING_S

READS: Final = 3  # the most reads in a cycle that has something to write, while the loop is held up
FRESH_S: Final = 0.006
"""On a slow link a command is decided on the newest status if that was requested within this time: the poll
interval and a bit. A read of three registers takes half of it."""
SOON_S: Final = 0.0025
"""Longest wait of a cycle for write_spacing: half of a usual period, so that its status is still fresh."""


STOP: Final = NextWrite(wait=0.0, is_urgent=True, is_command=False, is_stop=True)  # its first write


class CycleStep(Enum):
    """A step of a cycle."""

    READ = "read the status"
    WAIT = "wait until the write may leave"
    WRITE = "write"
    WRITE_AND_READ = "write, and read in the same exchange where link and request allow that"


# Each poll uses them, and Python 3.11 finds a member of an Enum by a detour.
READ, WAIT, WRITE, WRITE_AND_READ = CycleStep


def next_step(write: NextWrite, reads: int, age: float, *, is_stale: bool, is_slow: bool) -> CycleStep | None:
    """The next step of a cycle that has something to write; None if that must wait for another cycle.

    Args:
        write: the next write.
        reads: how often the cycle has read the status.
        age: seconds since the newest status was requested.
        is_stale: whether the loop was held up in that time.
        is_slow: whether a read takes a good part of the poll interval.
    """
    if reads:
        if write.wait > SOON_S:
            return None
        if write.wait:
            return WAIT
        if not is_stale:
            return WRITE_AND_READ
        return READ if reads < READS else WRITE
    if is_stale:
        return READ
    if write.is_urgent and write.wait <= LONGEST_SPACING_S:
        return WAIT if write.wait else WRITE
    is_fresh = write.wait <= SOON_S and age + write.wait <= FRESH_S
    if is_slow and write.is_command and is_fresh:
        return WAIT if write.wait else WRITE_AND_READ
    return READ


def begins_at_once(write: NextWrite, *, is_slow: bool) -> bool:
    """Whether a cycle begins with this write, and so need not wait for the tick."""
    return write.is_urgent or (is_slow and write.wait <= SOON_S)
