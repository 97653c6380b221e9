"""LimitedLog: keeps strangers, or a bad network, from filling the log."""

from __future__ import annotations

import logging
import math
from collections.abc import Callable
from typing import Final

from ..runtime import Log, now

EVERY_S: Final = 10.0  # seconds between two messages of one kind


class LimitedLog:
    """Messages of one kind, about one source: the first at once, then one in 10 s with the number of all.

    Outside of an event loop it needs another clock.
    """

    def __init__(self, log: Log | None = None, clock: Callable[[], float] = now) -> None:
        self._log = log or Log()
        self._clock = clock
        self._next = -math.inf
        self._count = 0

    def warn(
        self, message: str, *arguments: object, exc_info: bool = False, level: int = logging.WARNING
    ) -> bool:
        """Log a warning, or count it; returns whether it was logged."""
        self._count += 1
        at = self._clock()
        if at < self._next:
            return False
        if self._count > 1:
            message += " (%d similar since the last report)"
            arguments += (self._count,)
        self._next, self._count = at + EVERY_S, 0
        self._log.log(level, message, *arguments, exc_info=exc_info)
        return True
