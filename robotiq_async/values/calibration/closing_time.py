"""How long a finger takes to close: the thesis's table A1.1, by which the simulated gripper moves.

The manual gives two figures, 22 and 110 mm/s; a curve between them was measured by the thesis that this
library follows (three runs of a full closing for every fourth speed value, without an object).
"""

from __future__ import annotations

from typing import Final

from .scales import SpeedCalibration

# Read when this is imported: whoever imports it may run in an event loop later, and waits for no disk there.
_THESIS: Final = SpeedCalibration.thesis()


def closing_time(speed: int) -> float:
    """Seconds of a full closing, from the open reading 6 to the closed reading 241.

    The mean of three measured runs, linear between the measured speed values. The runs of one value differ
    by less than 2 %.

    Args:
        speed: speed value, 0 slowest .. 255 fastest.

    Raises:
        TypeError: speed is not an int.
        ValueError: speed is outside 0..255.
    """
    return _THESIS.closing_time(speed)
