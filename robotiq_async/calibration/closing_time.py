"""How long a finger takes to close: the measured relation between the speed value and real speed.

The manual gives two figures, 22 and 110 mm/s; a curve between them was measured by the thesis that this
library follows (table A1.1: three runs of a full closing for every fourth speed value, without an object).
"""

from __future__ import annotations

from typing import Final

from ..wire.checks import check_byte

OPEN_READING: Final = 6
"""Position, in counts, that a fully open finger reads."""
CLOSED_READING: Final = 241
"""Position, in counts, that a fully closed finger reads (real ones read 240 or more)."""
STROKE_COUNTS: Final = CLOSED_READING - OPEN_READING
"""Counts between the two: the distance the measured times belong to."""

_STEP: Final = 4
# fmt: off
# Mean of the three runs in milliseconds, for the speed values 0, 4, 8 .. 252 and 255.
_MILLISECONDS: Final = (
    10021, 9545, 9003, 8551, 8128, 7744, 7356, 7065,
    6796, 6528, 6272, 6045, 5834, 5635, 5464, 5275,
    5126, 4963, 4825, 4688, 4568, 4442, 4324, 4225,
    4112, 4016, 3931, 3824, 3759, 3677, 3588, 3515,
    3455, 3395, 3322, 3248, 3196, 3140, 3092, 3036,
    2974, 2927, 2874, 2831, 2773, 2748, 2709, 2659,
    2618, 2581, 2549, 2502, 2477, 2453, 2409, 2394,
    2353, 2321, 2296, 2276, 2238, 2222, 2188, 2173,
    2119,
)
# fmt: on


def closing_time(speed: int) -> float:
    """Seconds of a full closing, from the open reading 6 to the closed reading 241.

    The mean of three measured runs (thesis, table A1.1), linear between the measured speed values. The
    runs of one value differ by less than 2 %.

    Args:
        speed: speed value, 0 slowest .. 255 fastest.

    Raises:
        TypeError: speed is not an int.
        ValueError: speed is outside 0..255.
    """
    index, past = divmod(check_byte("speed", speed), _STEP)
    if not past:
        return _MILLISECONDS[index] / 1000
    # The last interval is one value shorter: 252 to 255.
    width = min(_STEP, 255 - index * _STEP)
    slower, faster = _MILLISECONDS[index], _MILLISECONDS[index + 1]
    return (slower + (faster - slower) * past / width) / 1000
