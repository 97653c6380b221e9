"""Warnings about late polls, one a minute at most."""

from __future__ import annotations

import math
import sys
from collections.abc import Callable
from typing import Final

from ..hands.options import LATE_POLLS
from ..runtime.logger import Log

LATE_S: Final = 0.05
"""A poll that is later than this is worth a warning; on a busy machine a few milliseconds are usual."""
LATE_WARNING_S: Final = 60.0  # seconds between two warnings
HELD_UP: Final = "something holds up the event loop, or it was not running"
IN_IPYTHON: Final = " (as between the prompts of IPython's terminal: use robotiq_async.sync there)"


class LatePolls:
    """The late polls since the last warning; ``time`` is the clock of the loop."""

    def __init__(self, time: Callable[[], float], log: Log) -> None:
        self._time: Final = time
        self._log: Final = log
        self._warned = -math.inf
        self._late: list[float] = []  # seconds of each

    def note(self, late: float, held_up: float, missed: int) -> None:
        """Note a poll that is ``late`` seconds late, ``held_up`` of them because of the loop.

        ``missed`` is the number of polls that were missed so far.
        """
        self._late.append(late)
        now = self._time()
        if now - self._warned < LATE_WARNING_S:
            return
        self._warned = now
        why = "the gripper answers slowly" if held_up < late / 2 else HELD_UP + _where()
        late_polls, self._late = self._late, []
        often = "" if len(late_polls) == 1 else f"{len(late_polls)} times, at most "
        by = 1000 * max(late_polls)
        self._log.warning("%s, %s%.0f ms: %s (%d polls missed so far)", LATE_POLLS, often, by, why, missed)


def _where() -> str:
    """A hint for users of IPython's prompt; empty for others."""
    ipython = sys.modules.get("IPython")
    return IN_IPYTHON if ipython is not None and ipython.get_ipython() is not None else ""
