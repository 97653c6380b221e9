"""Where an axis is sent."""

from __future__ import annotations

from typing import NamedTuple

from robotiq_async.values.calibration.closing_time import closing_time
from robotiq_async.values.enums import STROKE_COUNTS


class Goal(NamedTuple):
    """Where an axis goes, how fast and with what force, in counts.

    Attributes:
        position: where to.
        speed: 0..255.
        force: 0..255.
        is_reading: the axis ends exactly at the position, without the spread of a request.
        stroke_time: seconds of a full stroke, if not those of the speed.
        clears: obstacles that are not fixed do not count.
    """

    position: int
    speed: int
    force: int
    is_reading: bool = False
    stroke_time: float = 0.0
    clears: bool = False

    @property
    def rate(self) -> float:
        """Counts a second."""
        return STROKE_COUNTS / (self.stroke_time or closing_time(self.speed))
