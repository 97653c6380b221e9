"""What strangers, or a bad network, may cause thousands of times does not fill the log."""

from __future__ import annotations

import logging
import math
from typing import Final

from ..runtime.clock import now
from ..runtime.log import Log, log

EVERY_S: Final = 10.0


class LimitedLog:
    """Of one kind, about one source: the first at once, then one in ten seconds, with how many there were."""

    def __init__(self, log: Log = log) -> None:
        self._log = log
        self._next = -math.inf
        self._count = 0

    def warn(
        self, message: str, *arguments: object, exc_info: bool = False, level: int = logging.WARNING
    ) -> bool:
        """Log a warning, or count it; returns whether it was logged.

        Args:
            message: for the logger.
            arguments: for the logger.
            exc_info: whether with the traceback of what is being handled.
            level: of the logger.
        """
        self._count += 1
        if now() < self._next:
            return False
        if self._count > 1:
            message += " (%d similar since the last report)"
            arguments += (self._count,)
        self._next, self._count = now() + EVERY_S, 0
        self._log.log(level, message, *arguments, exc_info=exc_info)
        return True
