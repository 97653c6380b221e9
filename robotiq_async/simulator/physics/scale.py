"""A scale between the simulated fingers: readings as in the thesis, with their scatter."""

from __future__ import annotations

import random
from typing import Literal

from robotiq_async.values.checks import check_byte

Surface = Literal["foam", "rigid"]

# Grams in three runs at the force values 0, 25 .. 250 (thesis, chapter 6; data/force_*_grams.csv).
# fmt: off
_GRAMS: dict[Surface, tuple[tuple[int, int, int], ...]] = {
    "foam": (
        (630, 650, 570), (500, 530, 550), (900, 930, 950), (900, 1600, 1840), (1300, 1250, 1250),
        (1900, 1110, 1160), (1600, 1760, 1830), (2100, 2520, 2500), (2000, 2350, 2410), (2500, 2510, 2530),
        (2600, 2510, 2540),
    ),
    "rigid": (
        (1930, 3000, 2930), (2920, 1500, 3000), (3000, 2950, 2900), (2900, 2320, 3000), (2400, 2850, 2830),
        (2950, 2880, 3000), (2600, 2440, 2900), (2940, 2920, 3000), (2850, 2960, 2850), (3000, 2900, 2970),
        (3000, 2900, 2930),
    ),
}
# fmt: on
_FORCE_STEP = 25
_RESOLUTION_G = 10


class SimulatedScale:
    """Reads grams: at a force value that the thesis measured, one between its lowest and highest reading."""

    def __init__(self, surface: Surface = "foam", seed: int = 0) -> None:
        """A scale with foam around it, or a rigid one.

        Args:
            surface: "foam" or "rigid".
            seed: of the scatter; the same seed, the same readings.

        Raises:
            ValueError: another surface.
        """
        if surface not in _GRAMS:
            raise ValueError(f"surface must be 'foam' or 'rigid', got {surface!r}")
        self._rows = _GRAMS[surface]
        self._random = random.Random(seed)

    def reading(self, force: int) -> int:
        """The reading at a force value, in steps of 10 g.

        Raises:
            TypeError: force is not an int.
            ValueError: force is outside 0..255.
        """
        at, past = divmod(check_byte("force", force), _FORCE_STEP)
        lower, upper = self._rows[at], self._rows[min(at + 1, len(self._rows) - 1)]
        share = past / _FORCE_STEP
        low = min(lower) + (min(upper) - min(lower)) * share
        high = max(lower) + (max(upper) - max(lower)) * share
        return round(self._random.uniform(low, high) / _RESOLUTION_G) * _RESOLUTION_G
