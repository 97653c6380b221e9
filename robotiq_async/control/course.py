"""The course of axes that move: how far each will have gone when a write acts.

A write acts a device cycle after it was sent. An axis that is to be held moves on meanwhile: asked for where
it was seen, it would drive back, 20 counts if the cycle is 0.2 s. So it is asked for where it will be, as far
as statuses tell.
"""

from __future__ import annotations

import math
from collections import deque
from typing import Final

from ..values.enums import Finger
from ..values.status import RobotiqStatus

BASELINE_S: Final = 0.25
"""The statuses of this time give the speed. Positions are whole counts: it is right to 4 counts a second."""
SPACING_S: Final = 0.02
"""Seconds between the statuses that are kept."""


class Course:
    """Some of the statuses in which an axis moves."""

    def __init__(self) -> None:
        # Each with the time at which it was asked for: a loop that is held up reads a reply late, and a speed
        # by the times of the replies would drive a held axis on to its request.
        self._kept: Final[deque[tuple[float, RobotiqStatus]]] = deque(
            maxlen=math.ceil(BASELINE_S / SPACING_S)
        )

    def keep(self, status: RobotiqStatus, asked: float) -> None:
        if not self._kept or asked >= self._kept[-1][0] + SPACING_S:
            self._kept.append((asked, status))

    def after(self, axis: Finger, request: int, status: RobotiqStatus, asked: float, seconds: float) -> int:
        """Its position so long after a status, on its way to a request; as it shows if it may stand.

        The status was asked for at ``asked``.
        """
        at, since, first = status.position(axis), asked, status
        # A fault stops the axes, and gDT shows a motion.
        if axis not in status.moving or status.fault.is_serious:
            return at
        for kept, each in reversed(self._kept):
            if axis not in each.moving or asked - kept > BASELINE_S:
                break
            since, first = kept, each
        time = asked - since
        place = at if time == 0 else at + int((at - first.position(axis)) * seconds / time)
        return sorted((at, place, request))[1]
