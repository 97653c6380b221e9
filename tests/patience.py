"""Time limits of tests: for events that come late on a busy machine, and never on a broken one."""

from __future__ import annotations

import os


def patience(seconds: float) -> float:
    """A limit that is generous on an idle machine and grows with the processes that wait for a core.

    The load is the average of the last minute. Windows has none.
    """
    waiting = os.getloadavg()[0] / (os.cpu_count() or 1) if hasattr(os, "getloadavg") else 1.0
    return seconds * max(1.0, waiting)
