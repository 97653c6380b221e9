"""A process that has of Python what it has on Windows, as far as that can be had elsewhere.

It goes without POSIX's modules, functions and signals, and without readers and signal handlers of the event
loop; for the library, imported afterwards, it counts as ``win32``. What the library imports comes before: it
was installed for the system that is really there. A real Windows has sockets, consoles, paths and timers of
its own; CI runs the tests of the core there.
"""

from __future__ import annotations

import asyncio
import ctypes
import importlib
import math
import os
import select
import signal
import socket
import sys
import time
import warnings
from functools import partial
from typing import Any

STEP_S = 1 / 64
MODULES = (
    *("curses", "fcntl", "grp", "posix", "pty", "pwd", "readline", "resource", "syslog", "termios", "tty"),
    "uvloop",
)
NAMES: dict[Any, str] = {
    os: "chown fchmod fchown fdatasync fork forkpty getegid geteuid getgid getloadavg getpgid getpgrp getsid"
    " getpriority getuid killpg lchown major makedev minor mkfifo mknod nice openpty pipe2 pread pwrite"
    " register_at_fork sched_getaffinity sched_yield sendfile setsid setuid statvfs sync sysconf"
    " timerfd_create timerfd_settime ttyname uname"
    " O_CLOEXEC O_DIRECTORY O_NOCTTY O_NOFOLLOW O_NONBLOCK O_SYNC",
    select: "epoll poll",
    signal: "SIGALRM SIGCHLD SIGCONT SIGHUP SIGKILL SIGPIPE SIGQUIT SIGSTOP SIGTSTP SIGUSR1 SIGUSR2 SIGWINCH"
    " alarm pause pthread_kill pthread_sigmask setitimer sigwait",
    socket: "AF_UNIX SO_REUSEPORT",
    time: "CLOCK_BOOTTIME CLOCK_MONOTONIC clock_gettime tzset",
}
LOOP = "add_reader add_writer add_signal_handler remove_signal_handler"
THEIRS = (
    *("anyio._backends._asyncio", "platform", "pymodbus.client", "pymodbus.server"),
    *("serial.tools.list_ports", "shutil", "subprocess", "tempfile"),
    *("cyclopts", "mcap.reader", "mcap.writer", "rich.live", "webbrowser"),
    *("textual.app", "textual.drivers.headless_driver", "textual.widgets"),
)
"""Modules that the library imports."""


class Winmm:
    """Windows' library of timers.

    Attributes:
        periods: how many ask for interrupts every millisecond at present.
        asked: how often somebody has asked for them.
    """

    periods = asked = 0

    def __init__(self, name: str) -> None:
        assert name == "winmm"

    @classmethod
    def timeBeginPeriod(cls, milliseconds: int) -> int:  # noqa: N802  # Windows' name
        assert milliseconds == 1
        cls.periods += 1
        cls.asked += 1
        return 0

    @classmethod
    def timeEndPeriod(cls, milliseconds: int) -> int:  # noqa: N802
        assert milliseconds == 1
        cls.periods -= 1
        return 0


def become(*, coarse: bool = False) -> None:
    """Give up what Windows has not.

    Args:
        coarse: have the clock of Python before 3.13, too.
    """
    for name in THEIRS:
        importlib.import_module(name)
    importlib.import_module("pymodbus.transport.serialtransport").SerialTransport.force_poll = True
    ctypes.WinDLL = Winmm  # type: ignore[attr-defined]
    # A pair is of UNIX sockets here, whatever has that name.
    socket.socketpair = partial(socket.socketpair, socket.AF_UNIX)
    for name in MODULES:
        sys.modules[name] = None  # type: ignore[assignment]
    signal.SIGBREAK = signal.SIGUSR1  # type: ignore[attr-defined]
    for module, names in NAMES.items():
        for name in names.split():
            vars(module).pop(name, None)
    for name in LOOP.split():
        setattr(asyncio.SelectorEventLoop, name, getattr(asyncio.AbstractEventLoop, name))
    _wake_loops_by_signals()
    if coarse:
        _count_in_steps()
    sys.platform = "win32"
    # Windows' default is no UTF-8.
    warnings.filterwarnings("error", category=EncodingWarning, module=r"robotiq_async|pytest_robotiq_async")


def _wake_loops_by_signals() -> None:
    # As the loop of Windows does when it is made in the main thread.
    run_forever = asyncio.SelectorEventLoop.run_forever

    def run(loop: Any) -> None:
        try:
            before = signal.set_wakeup_fd(loop._csock.fileno(), warn_on_full_buffer=False)
        except ValueError:  # no main thread
            run_forever(loop)
            return
        try:
            run_forever(loop)
        finally:
            signal.set_wakeup_fd(before)

    asyncio.SelectorEventLoop.run_forever = run  # type: ignore[assignment]


def _count_in_steps() -> None:
    exact, info = time.monotonic, time.get_clock_info

    def monotonic() -> float:
        return math.floor(1000 * math.floor(exact() / STEP_S) * STEP_S) / 1000

    def get_clock_info(name: Any) -> Any:
        found = info(name)
        if name == "monotonic":
            found.resolution = STEP_S
        return found

    time.monotonic, time.get_clock_info = monotonic, get_clock_info
