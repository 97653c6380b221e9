"""How a stop leaves the fingers."""

from __future__ import annotations

from enum import IntEnum
from typing import Self


class Ending(IntEnum):
    """Ordered by strength: of several stops under way the strongest counts."""

    LEAVE = 0
    """The fingers go on."""
    KEEP = 1
    """Axes that move are held, and rGTO stays set if every axis is seen at rest."""
    HALT = 2
    """rGTO is cleared."""

    @classmethod
    def of(cls, *, halt: bool, keep_grip: bool) -> Self:
        """The ending for the arguments of ``stop()``."""
        if not halt:
            return cls(cls.LEAVE)
        return cls(cls.KEEP if keep_grip else cls.HALT)

    @property
    def done(self) -> str:
        """The participle for messages: the fingers are ..."""
        return ("left as they are", "held", "stopped")[self]
