"""Time limits of tests: for events that come late on a busy machine, and never on a broken one."""

from __future__ import annotations

import contextlib
import faulthandler
import math
import os
import time
from pathlib import Path


def patience(seconds: float) -> float:
    """A limit that is generous on an idle machine and grows with the processes that wait for a core.

    The load is the average of the last minute, or on Linux what runs now, which is more when something big
    has just begun. Windows has none.
    """
    load = os.getloadavg()[0] if hasattr(os, "getloadavg") else 1.0
    with contextlib.suppress(OSError):
        load = max(load, int(Path("/proc/loadavg").read_text(encoding="ascii").split()[3].partition("/")[0]))
    return seconds * max(1.0, load / (os.cpu_count() or 1))


class HangWatch:
    """Ends the run when a test hangs, and shows where: its set-up has the limit, then the test with its end.

    On a busy machine they have more. Reading the load and setting the alarm each cost as much as a short
    test: the load is read once a second, and the alarm set again only after a set-up of more than a second.
    """

    def __init__(self, limit: float) -> None:
        """``limit`` is in seconds; 0 for none."""
        self._limit = self._seconds = limit
        self._stderr = os.dup(2)  # that of this process: what a test writes is captured
        self._looked = self._began = -math.inf

    def begin(self) -> None:
        if not self._limit:
            return
        self._began = time.monotonic()
        if self._began - self._looked > 1:
            self._looked, self._seconds = self._began, patience(self._limit) + 1
        faulthandler.dump_traceback_later(self._seconds, exit=True, file=self._stderr)

    def go_on(self) -> None:
        if time.monotonic() - self._began > 1:
            self.begin()

    def end(self) -> None:
        faulthandler.cancel_dump_traceback_later()
