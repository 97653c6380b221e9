"""What becomes of the fingers when a hand is stopped."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class Ending(IntEnum):
    """The gentlest first: of several stops under way the strongest counts."""

    LEAVE = 0
    """They go on with what they do."""
    KEEP = 1
    """What moves is held, and rGTO stays set if everything is seen at rest."""
    HALT = 2
    """rGTO is cleared."""

    @classmethod
    def of(cls, *, halt: bool, keep_grip: bool) -> Self:
        """What the arguments of ``stop()`` ask for."""
        if not halt:
            return cls(cls.LEAVE)
        return cls(cls.KEEP if keep_grip else cls.HALT)

    @property
    def done(self) -> str:
        """What the fingers are then."""
        return ("left as they are", "held", "stopped")[self]
