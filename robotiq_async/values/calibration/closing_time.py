"""Closing times of a finger from the thesis's table A1.1; the simulated gripper moves by them.

The manual gives only two figures, 22 and 110 mm/s. The thesis measured the curve between them: three runs of
a full closing for every fourth speed value, without an object.
"""

from __future__ import annotations

from typing import Final

from .scales import SpeedCalibration

# Read at import: a program may later run in an event loop, which must not wait for a disk.
_THESIS: Final = SpeedCalibration.thesis()


def closing_time(speed: int) -> float:
    """Seconds of a full closing, from the open reading 6 to the closed reading 241.

    The mean of three measured runs, linear between the measured speed values. The runs of one value differ by
    less than 2 %.

    Args:
        speed: speed value, 0 slowest .. 255 fastest.

    Raises:
        TypeError: speed is not an int.
        ValueError: speed is outside 0..255.
    """
    return _THESIS.closing_time(speed)
