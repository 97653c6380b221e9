"""Time limits of tests: for events that come late on a busy machine, and never on a broken one."""

from __future__ import annotations

import contextlib
import os
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
