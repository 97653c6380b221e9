"""Waits of whole milliseconds on Windows, where a wait ends with an interrupt: by default 64 come a second.

``timeBeginPeriod(1)`` of its library winmm requests a thousand, until ``timeEndPeriod(1)``; since Windows 10
2004 that affects no other process. Each call of :func:`begin` needs a call of :func:`end`. Elsewhere both do
nothing.
"""

from __future__ import annotations

import sys

if sys.platform == "win32":
    import ctypes

    _winmm = ctypes.WinDLL("winmm")

    def begin() -> None:
        """Ask for waits of whole milliseconds."""
        _winmm.timeBeginPeriod(1)

    def end() -> None:
        """Take that back."""
        _winmm.timeEndPeriod(1)

else:

    def begin() -> None:
        """Do nothing: waits are finer."""

    def end() -> None:
        """Do nothing."""
