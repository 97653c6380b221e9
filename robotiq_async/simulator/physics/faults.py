"""The faults that are present, with their end times."""

from __future__ import annotations

import math
from typing import Final

from robotiq_async.values.enums import Fault, Severity

BLOCKED_AFTER: Final = 20.0
"""Seconds of interference on the scissor until the minor fault becomes a major one (manual 2012, 4.7)."""

_RANK: Final = {Severity.NONE: 0, Severity.PRIORITY: 1, Severity.MINOR: 2, Severity.MAJOR: 3}


class PresentFaults:
    """A set of faults with end times. Times are simulated seconds.

    Attributes:
        worst: the most serious fault; NONE without any.
        changes_at: the time at which one ends or becomes another; infinite if none does.
    """

    def __init__(self) -> None:
        self._ends: dict[Fault, float] = {}
        self.clear()

    def begin(self, fault: Fault, time: float, duration: float | None) -> None:
        """Add a fault, for a while or (None) until it is cleared."""
        self._ends[fault] = math.inf if duration is None else time + duration
        if fault is Fault.SCISSOR_INTERFERENCE:
            self._escalates_at = time + BLOCKED_AFTER
        self._weigh()

    def clear(self) -> None:
        self._ends.clear()
        self._escalates_at = math.inf
        self._weigh()

    def update(self, time: float) -> None:
        """End the faults whose time is over; interference that has lasted 20 s becomes the major fault."""
        self._ends = {fault: end for fault, end in self._ends.items() if end > time}
        if Fault.SCISSOR_INTERFERENCE not in self._ends:
            self._escalates_at = math.inf
        elif self._escalates_at <= time:
            del self._ends[Fault.SCISSOR_INTERFERENCE]
            self._ends[Fault.SCISSOR_BLOCKED] = self._escalates_at = math.inf
        self._weigh()

    def _weigh(self) -> None:
        self.worst: Fault = max(self._ends, key=lambda fault: _RANK[fault.severity], default=Fault.NONE)
        self.changes_at: float = min(self._escalates_at, min(self._ends.values(), default=math.inf))

    @property
    def stops_scissor(self) -> bool:
        return any(fault.is_serious for fault in self._ends)

    @property
    def stops_fingers(self) -> bool:
        """Whether a minor or major fault keeps the fingers from moving.

        Interference on the scissor leaves the fingers alone as long as it is minor.
        """
        return any(fault.is_serious and fault is not Fault.SCISSOR_INTERFERENCE for fault in self._ends)
