"""Checks in a forked process."""

from __future__ import annotations

import os
import signal
import sys


def in_the_child(check: object) -> int:
    """The exit code of a forked process: 0 when the check passed there."""
    assert callable(check)
    pid = os.fork()
    if pid == 0:
        code = 1
        signal.alarm(10)  # one that hangs is killed
        try:
            check()
            code = 0
        except BaseException as error:  # noqa: BLE001
            sys.stderr.write(f"{error!r}\n")
        finally:
            os._exit(code)
    return os.waitstatus_to_exitcode(os.waitpid(pid, 0)[1])
