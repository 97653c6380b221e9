"""Linux's timerfd: a timer of the kernel that is watched like a socket (timerfd_create(2)).

Python has it from 3.13 on; before, it is called in the C library.
"""

from __future__ import annotations

import errno
import os
import sys
import time

if sys.platform == "linux" and sys.version_info >= (3, 13):

    class TimerFd:
        """A timer, and its descriptor: ready from the time it is set to until it is set again."""

        def __init__(self) -> None:
            self.descriptor = os.timerfd_create(time.CLOCK_MONOTONIC, flags=os.TFD_NONBLOCK | os.TFD_CLOEXEC)

        def arm(self, when: float) -> None:
            """Set it to a time of ``time.monotonic()``, in seconds; a past time fires at once."""
            os.timerfd_settime(self.descriptor, flags=os.TFD_TIMER_ABSTIME, initial=when)

        def close(self) -> None:
            """Give the descriptor back."""
            os.close(self.descriptor)

elif sys.platform == "linux":
    import ctypes

    _libc = ctypes.CDLL(None, use_errno=True)
    _ABSOLUTE = 1  # TFD_TIMER_ABSTIME

    class _Itimerspec(ctypes.Structure):
        """The interval, which stays 0 (once), and the time."""

        _fields_ = tuple(
            (name, ctypes.c_long)
            for name in ("interval_seconds", "interval_nanoseconds", "seconds", "nanoseconds")
        )
        seconds: int
        nanoseconds: int

    class TimerFd:
        """A timer, and its descriptor: ready from the time it is set to until it is set again."""

        def __init__(self) -> None:
            # TFD_NONBLOCK and TFD_CLOEXEC have the values of O_NONBLOCK and O_CLOEXEC of open(2).
            self.descriptor: int = _checked(
                _libc.timerfd_create(time.CLOCK_MONOTONIC, os.O_NONBLOCK | os.O_CLOEXEC)
            )
            self._time = _Itimerspec()
            self._at = ctypes.byref(self._time)

        def arm(self, when: float) -> None:
            """Set it to a time of ``time.monotonic()``, in seconds; a past time fires at once."""
            self._time.seconds, self._time.nanoseconds = divmod(round(when * 1e9), 1_000_000_000)
            _checked(_libc.timerfd_settime(self.descriptor, _ABSOLUTE, self._at, None))

        def close(self) -> None:
            """Give the descriptor back."""
            os.close(self.descriptor)

    def _checked(result: int) -> int:
        if result < 0:
            code = ctypes.get_errno()
            raise OSError(code, os.strerror(code))
        return result

else:

    class TimerFd:
        """This system has no timerfd: making one raises OSError."""

        descriptor = -1

        def __init__(self) -> None:
            raise OSError(errno.ENOSYS, "timerfd is Linux's")

        def arm(self, when: float) -> None:
            pass

        def close(self) -> None:
            pass
