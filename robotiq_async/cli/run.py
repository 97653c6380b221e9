"""Runs a sub-command: signals, errors and exit codes."""

from __future__ import annotations

import asyncio
import inspect
import io
import os
import signal
import socket
import sys
from collections.abc import Callable, Coroutine, Iterator, Sequence
from contextlib import closing, contextmanager, suppress
from types import FrameType
from typing import Self

from cyclopts import CycloptsError

from ..values.errors import RobotiqError
from .app import build
from .failures import CommandError, UsageError
from .output.log_capture import collected_warnings, forget
from .output.notices import tell

_ENDING = [getattr(signal, name) for name in ("SIGINT", "SIGTERM", "SIGHUP") if hasattr(signal, name)]
SUCCESS, FAILURE, WRONG_USAGE, SIGNALLED = 0, 1, 2, 128


def run(arguments: Sequence[str]) -> int:
    """Run the sub-command that the arguments name and return the exit code."""
    _mend_streams()
    with collected_warnings() as warnings, _Signals() as signals:
        code, problem = _outcome(arguments, signals)
    # A failure is one line, whatever it holds: it is read in logs and by scripts.
    lines = warnings if problem is None else ["; ".join((problem, *warnings))]
    try:
        for line in lines:
            tell(" ".join(line.split()))
    except OSError:  # the terminal is gone
        forget(sys.stderr)
    return code


def _mend_streams() -> None:
    """Replace closed standard streams by the null device; let the others escape what they cannot encode."""
    for name, mode in (("stdin", "r"), ("stdout", "w"), ("stderr", "w")):
        stream = getattr(sys, name)
        if stream is None:  # its number is free, and no socket is to get it
            setattr(sys, name, open(os.devnull, mode, encoding="utf-8"))  # noqa: SIM115
        elif mode == "w" and isinstance(stream, io.TextIOWrapper):
            stream.reconfigure(errors="backslashreplace")


def _outcome(arguments: Sequence[str], signals: _Signals) -> tuple[int, str | None]:
    """The exit code, and the reason if there is one."""
    try:
        command, bound, _ = build().parse_args(arguments, print_error=False, exit_on_error=False)
        outcome = command(*bound.args, **bound.kwargs)
        if inspect.iscoroutine(outcome):
            with closing(outcome):  # a signal may come before it has begun
                signals.run(outcome)
        sys.stdout.flush()
    except (CycloptsError, UsageError) as error:
        return WRONG_USAGE, str(error)
    except (RobotiqError, CommandError) as error:
        return FAILURE, str(error)
    except BrokenPipeError:
        # Whoever read the output has had enough (status | head); the flush at exit must not fail over it.
        forget(sys.stdout)
        return FAILURE, None
    except SystemExit:
        # So rich ends a program whose output nobody reads; it has forgotten the stream.
        return FAILURE, None
    except OSError as error:
        # The environment's doing: a full disk behind standard output, say.
        return FAILURE, str(error)
    except KeyboardInterrupt:
        return SIGNALLED + (signals.received or signal.SIGINT), "interrupted"
    return SUCCESS, None


class _Signals:
    """SIGINT, SIGTERM and SIGHUP (a terminal that is closed): the first one ends what runs.

    A second SIGINT has its ordinary effect; of the others no second one is heard, for closing a terminal
    sends several, and none of them may keep the first from stopping the fingers.

    In the event loop that is a cancellation, so that leaving ``async with`` stops the fingers; elsewhere
    it is a KeyboardInterrupt. While the loop is set up the signal is only noted: asyncio could not tell
    an exception out of nowhere from one of its own.
    """

    def __init__(self) -> None:
        self.received = 0
        self._end: Callable[[], object] = _interrupt

    def __enter__(self) -> Self:
        # A SIGINT that is ignored stays so: that is how a shell keeps Ctrl-C from its background jobs.
        numbers = [number for number in _ENDING if signal.getsignal(number) is not signal.SIG_IGN]
        self._previous = {number: signal.signal(number, self._handle) for number in numbers}
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._previous.items():
            signal.signal(number, handler)

    def run(self, work: Coroutine[object, object, None]) -> None:
        """Run to the end.

        Raises:
            KeyboardInterrupt: a signal came.
        """
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
            with suppress(RuntimeError):  # the loop has been closed meanwhile
                loop.call_soon_threadsafe(task.cancel)

        self._end = cancel
        if self.received:
            raise asyncio.CancelledError
        with _awake(loop):
            await work

    def _handle(self, number: int, _frame: FrameType | None) -> None:
        for each, before in self._previous.items():
            signal.signal(each, before if each == signal.SIGINT else _unheard)
        self.received = number
        self._end()


@contextmanager
def _awake(loop: asyncio.AbstractEventLoop) -> Iterator[None]:
    """Let every signal wake the loop.

    One that comes while the loop goes to sleep, or that the system hands to another thread, would be
    noticed only when something else wakes it: an idle server would have to be told twice.
    """
    reading, writing = socket.socketpair()
    with reading, writing:
        reading.setblocking(False)
        writing.setblocking(False)
        try:
            loop.add_reader(reading, reading.recv, 64)
        except NotImplementedError:  # Windows, where a loop does not sleep so soundly
            yield
            return
        before = signal.set_wakeup_fd(writing.fileno(), warn_on_full_buffer=False)
        try:
            yield
        finally:
            signal.set_wakeup_fd(before)
            loop.remove_reader(reading)


def _unheard(_number: int, _frame: FrameType | None) -> None:
    """The end has begun already."""


def _interrupt() -> None:
    raise KeyboardInterrupt
