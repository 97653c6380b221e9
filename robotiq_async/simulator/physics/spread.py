"""Differences of one gripper from another, and of each from the ideal one.

Figures in the sources: an open hand reads 7, 6, 6, and one object is held at 188, 193 and 189 (manual 2014,
pp. 70-74); a closed finger reads 240 or more, and others stop within 1 to 2 counts (manual); 111 and 208 were
requested and 112 and 210 reached (poses that TAMS recorded); a contact is precise to some millimetres only
(manual 2012, 4.7), of which a count is 0.66.

No random numbers are drawn while it runs: a figure follows from the seed, the axis and its request. So it
does not depend on how often it is read, and a repeated motion ends in the same way.
"""

from __future__ import annotations

from random import Random
from typing import Final

from robotiq_async.values.enums import Finger

SEED: Final = 4
"""Seed with which an open hand reads 7, 6, 6, as the manual prints it."""
_TOLERANCE: Final = 2


class Spread:
    """The figures of one axis. Without a seed there is no spread: the axis is exact."""

    def __init__(self, seed: int | None, axis: Finger) -> None:
        self._seed = seed
        self._axis = axis

    @property
    def tolerance(self) -> int:
        """Counts within which an axis at rest has reached its request."""
        return 0 if self._seed is None else _TOLERANCE

    @property
    def open_reading(self) -> int:
        """Counts that an open finger reads above the usual 6."""
        return self._figure("open", 0, 1)

    @property
    def closed_reading(self) -> int:
        """Counts that a closed finger reads above or below the usual 241."""
        return self._figure("closed", -1, 1)

    def overshoot(self, position: int) -> int:
        """Counts, or none, by which the axis overshoots a request between its stops."""
        return self._figure(f"goes past {position}", 0, _TOLERANCE)

    def contact(self, position: int) -> int:
        """Counts from the position of an object to that of the contact."""
        return self._figure(f"contact at {position}", -2, 3)

    def _figure(self, what: str, low: int, high: int) -> int:
        """A whole number in low..high for one purpose; 0 without a spread."""
        if self._seed is None:
            return 0
        return low + int(Random(f"{self._seed} {self._axis.value} {what}").random() * (high - low + 1))
