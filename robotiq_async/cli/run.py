"""Runs a sub-command: signals, errors and exit codes."""

from __future__ import annotations

import asyncio
import inspect
import io
import os
import re
import signal
import socket
import sys
import time
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from itertools import pairwise
from types import FrameType
from typing import Self

from cyclopts import CycloptsError

from ..hands import LATE_POLLS
from ..runtime import ending_signals
from ..values import RobotiqError
from .app import build
from .arguments import AMOUNT_UNITS
from .commands.ports import with_ports
from .failures import CommandError, UsageError
from .output.messages import forget, forwarded_warnings, tell

SUCCESS, FAILURE, WRONG_USAGE, SIGNALLED = 0, 1, 2, 128
EXIT_INSIST_S = 10.0
"""Seconds after the first signal in which a further Ctrl-C is ignored. A stop takes 2 s at most, a report of
verify a few more."""


def run(arguments: Sequence[str]) -> int:
    """Run the sub-command that the arguments name and return the exit code."""
    _mend_streams()
    warnings: list[str] = []

    def keep(warning: str) -> None:
        # A command that ends soon imports while it polls: a late poll there is no news for its user.
        if LATE_POLLS not in warning:
            warnings.append(warning)

    with forwarded_warnings(keep), _EndingSignals() as signals:
        code, problem = _outcome(arguments, signals)
    # A failure is always one line, for logs and scripts.
    if problem is not None:
        lines = ["; ".join((problem, *(each for each in warnings if problem not in each)))]
    else:
        lines = warnings
    try:
        for line in lines:
            tell(" ".join(line.split()))
    except OSError:  # the terminal is gone
        forget(sys.stderr)
    try:
        sys.stdout.flush()
    except OSError:  # at the exit it would end the process with 120
        forget(sys.stdout)
    return code


def _mend_streams() -> None:
    # Services run with closed streams, and not every terminal can show every character.
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:  # closed: a socket must not get its file descriptor
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
        elif mode == "w" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _outcome(arguments: Sequence[str], signals: _EndingSignals) -> tuple[int, str | None]:
    try:
        _check_units(arguments)
        command, bound, _ = build(arguments).parse_args(arguments, print_error=False, exit_on_error=False)
        outcome = command(*bound.args, **bound.kwargs)
        if inspect.iscoroutine(outcome):
            with closing(outcome):  # a signal may come before it has begun
                signals.run(outcome)
        sys.stdout.flush()
    except (CycloptsError, UsageError) as error:
        return WRONG_USAGE, str(error)
    except RobotiqError as error:
        return FAILURE, with_ports(error)
    except CommandError as error:
        return FAILURE, str(error)
    except BrokenPipeError:
        # The reader has closed the pipe (status | head); the flush at exit must not fail.
        forget(sys.stdout)
        return FAILURE, None
    except SystemExit:
        # rich does this when the reader has closed the pipe; it has redirected the stream.
        return FAILURE, None
    except OSError as error:
        # Caused by the environment: for example a full disk behind standard output.
        return FAILURE, str(error)
    except KeyboardInterrupt:
        return SIGNALLED + (signals.received or signal.SIGINT), "interrupted"
    return SUCCESS, None


def _check_units(arguments: Sequence[str]) -> None:
    """Refuse ``40 mm``: the unit would be taken for the address. And ``-1mm``, which looks like an option."""
    units = [unit for unit in AMOUNT_UNITS if unit]
    for number, unit in pairwise(arguments):
        if unit in units and re.fullmatch(r"[+-]?[0-9.,]+", number):
            raise UsageError(f"a number and its unit are one word: {number}{unit}")
    below = re.compile(rf"-[0-9.,]+ ?({'|'.join(map(re.escape, units))})")
    for amount in filter(below.fullmatch, arguments):
        raise UsageError(f"an amount must be 0 or more, got {amount!r}")


class _EndingSignals:
    """The first SIGINT, SIGTERM, SIGHUP (a closed terminal) or SIGBREAK (Windows) ends the command.

    Further ones are ignored: closing a terminal sends several, a person may press Ctrl-C again and again, and
    none of them may prevent the first from stopping the fingers. Only a SIGINT that comes more than
    ``insist_s`` seconds later has its ordinary effect.

    In the event loop the signal is a cancellation, so that leaving ``async with`` stops the fingers;
    elsewhere it is a KeyboardInterrupt. While the loop is being set up the signal is only noted: asyncio
    could not handle an exception there.
    """

    def __init__(self, insist_s: float = EXIT_INSIST_S) -> None:
        self.received = 0
        self._insist_s = insist_s
        self._received_at = 0.0
        self._end: Callable[[], object] = _interrupt

    def __enter__(self) -> Self:
        self._previous = {number: signal.signal(number, self._handle) for number in ending_signals()}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def run(self, work: Coroutine[object, object, None]) -> None:
        self._end = lambda: None
        try:
            with closing(self._cancellable(work)) as main:
                asyncio.run(main)
        except asyncio.CancelledError:
            if not self.received:
                raise
            raise KeyboardInterrupt from None
        finally:
            self._end = _interrupt

    async def _cancellable(self, work: Coroutine[object, object, None]) -> None:
        loop, task = asyncio.get_running_loop(), asyncio.current_task()
        assert task is not None

        def cancel() -> None:
            with suppress(RuntimeError):  # the loop has been closed
                loop.call_soon_threadsafe(task.cancel)

        self._end = cancel
        if self.received:
            raise asyncio.CancelledError
        with _awake(loop):
            await work

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        if not self.received:
            self.received, self._received_at = number, time.monotonic()
            self._end()
        elif number == signal.SIGINT and time.monotonic() - self._received_at > self._insist_s:
            _interrupt()


@contextmanager
def _awake(loop: asyncio.AbstractEventLoop) -> Iterator[None]:
    # Every signal wakes the loop. One that comes just before the loop sleeps, or that the system hands to
    # another thread, would otherwise wait for the next event: an idle server would not end.
    reading, writing = socket.socketpair()
    with reading, writing:
        reading.setblocking(False)
        writing.setblocking(False)
        try:
            loop.add_reader(reading, reading.recv, 64)
        except NotImplementedError:  # Windows, whose loop does the same by itself
            yield
            return
        before = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(before)
            loop.remove_reader(reading)


def _interrupt() -> None:
    raise KeyboardInterrupt
