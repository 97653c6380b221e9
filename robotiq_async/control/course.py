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
        # Each with the time at which it was asked for: a loop that is held up reads a reply late, and a speed
        # by the times of the replies would drive a held axis on to its request.
        self._statuses: Final[deque[tuple[float, RobotiqStatus]]] = deque(maxlen=MOST_STATUSES)

    def update(self, status: RobotiqStatus, asked: float) -> None:
        if status.moving:
            self._statuses.append((asked, status))
        elif self._statuses:
            self._statuses.clear()

    def after(self, axis: Finger, status: RobotiqStatus, seconds: float) -> int:
        """Its position so long after a status; that of the status if it is not known to move."""
        at = status.position(axis)
        if not self._statuses or self._statuses[-1][1] is not status:
            return at
        last, _ = since, first = self._statuses[-1]
        for asked, each in reversed(self._statuses):
            if axis not in each.moving or last - asked > BASELINE_S:
                break
            since, first = asked, each
        time = last - since
        return at if time == 0 else at + int((at - first.position(axis)) * seconds / time)
