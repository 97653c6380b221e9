"""The course of axes that move: how far each will have gone when a write acts.

A write acts a device cycle after it was sent. An axis that is to be held moves on meanwhile: asked for where
it was seen, it would drive back, 20 counts if the cycle is 0.2 s. So it is asked for where it will be, as far
as statuses tell.
"""

from __future__ import annotations

from collections import deque
from typing import Final

from ..values.enums import Finger
from ..values.status import RobotiqStatus

BASELINE_S: Final = 0.25
"""The statuses of this time give the speed. Positions are whole counts: it is right to 4 counts a second."""
MOST_STATUSES: Final = 256  # as many as the shortest poll interval makes in that time


class Course:
    """The statuses in a row in which an axis moves."""

    def __init__(self) -> None:
        self._statuses: Final[deque[RobotiqStatus]] = deque(maxlen=MOST_STATUSES)

    def update(self, status: RobotiqStatus) -> None:
        if status.moving:
            self._statuses.append(status)
        elif self._statuses:
            self._statuses.clear()

    def after(self, axis: Finger, status: RobotiqStatus, seconds: float) -> int:
        """Its position so long after a status; that of the status if it is not known to move."""
        at, first = status.position(axis), status
        if not self._statuses or self._statuses[-1] is not status:
            return at
        for each in reversed(self._statuses):
            if axis not in each.moving or status.timestamp - each.timestamp > BASELINE_S:
                break
            first = each
        time = status.timestamp - first.timestamp
        return at if time == 0 else at + int((at - first.position(axis)) * seconds / time)
