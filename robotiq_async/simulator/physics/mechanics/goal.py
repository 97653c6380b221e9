"""Where an axis is sent."""

from __future__ import annotations

from typing import NamedTuple

from robotiq_async.values.calibration.scales import SpeedCalibration


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

    def rate(self, speeds: SpeedCalibration) -> float:
        """Counts a second."""
        return speeds.stroke.counts / (self.stroke_time or speeds.closing_time(self.speed))
