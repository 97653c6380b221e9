"""Differences of one gripper from another, and of each from the ideal one.

Figures in the sources: an open hand reads 7, 6, 6, and one object is held at 188, 193 and 189 (manual 2014,
pp. 70-74); a closed finger reads 240 or more, and others stop within 1 to 2 counts (manual); 111 and 208 were
requested and 112 and 210 reached (poses that TAMS recorded); a contact is precise to some millimetres only
(manual 2012, 4.7), of which a count is 0.66. A 2F-85 read one part at 91 three times at speed 0, at 91 to 93
at 128, and at 97, 96 and 99 at 255; in 3 of these 9 grips gOBJ came with or before the last change of gPO, by
up to 50 ms (recorded, registers sampled every 6.5 ms).

No random numbers are drawn while it runs: a figure follows from the seed, the axis, its request, and for a
contact of a jaw from the number of contacts before it. So it does not depend on how often it is read, and a
repeated run ends in the same way.
"""

from __future__ import annotations

from random import Random
from typing import Final

from robotiq_async.values.enums import Finger

SEED: Final = 4
"""Seed with which an open hand reads 7, 6, 6, as the manual prints it."""
_TOLERANCE: Final = 2
_MOST_OVERRUN: Final = 2
_MOST_EARLY_S: Final = 0.02


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
        """Counts by which the axis overshoots a request between its stops; may be 0."""
        return self._figure(f"goes past {position}", 0, _TOLERANCE)

    def contact(self, position: int) -> int:
        """Counts from the position of an object to the position of the contact."""
        return self._figure(f"contact at {position}", -2, 3)

    @property
    def most_overrun(self) -> int:
        """The most counts that :meth:`overrun` gives."""
        return 0 if self._seed is None else _MOST_OVERRUN

    def overrun(self, contact: int, share: float) -> int:
        """Counts by which a jaw's contact reads further than usual, by its number and share of the speed."""
        return round(self._figure(f"overruns contact {contact}", -1, _MOST_OVERRUN) * share)

    def early(self, contact: int) -> float:
        """Seconds before its last count at which a jaw's contact is reported; mostly 0: after it."""
        return _MOST_EARLY_S if self._figure(f"reports contact {contact} early", -1, 1) > 0 else 0.0

    def _figure(self, what: str, low: int, high: int) -> int:
        """A whole number in low..high for one purpose; 0 without a spread."""
        if self._seed is None:
            return 0
        return low + int(Random(f"{self._seed} {self._axis.value} {what}").random() * (high - low + 1))
