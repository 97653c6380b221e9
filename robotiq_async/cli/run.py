"""Runs a sub-command: signals, errors and exit codes."""

from __future__ import annotations

import asyncio
import inspect
import os
import signal
import sys
from collections.abc import Awaitable, Callable, Iterator, Sequence
from contextlib import contextmanager
from types import FrameType

from cyclopts import CycloptsError

from ..errors import RobotiqError
from .app import build
from .arguments import UsageError
from .remarks import collected

SUCCESS, FAILURE, WRONG_USAGE, SIGNALLED = 0, 1, 2, 128


class _SignalError(Exception):
    """A signal has ended the command."""

    def __init__(self, number: int) -> None:
        self.code = SIGNALLED + number
        super().__init__("interrupted")


def run(arguments: Sequence[str]) -> int:
    """Run the sub-command that the arguments name and return the exit code."""
    with collected() as remarks:
        code, problem = _outcome(arguments)
    # A failure is one line, whatever it holds: it is read in logs and by scripts.
    lines = remarks if problem is None else ["; ".join((problem, *remarks))]
    for line in lines:
        print("robotiq-async:", " ".join(line.split()), file=sys.stderr)
    return code


def _outcome(arguments: Sequence[str]) -> tuple[int, str | None]:
    """The exit code and the reason, if there is one to tell."""
    try:
        command, bound, _ = build().parse_args(arguments, print_error=False, exit_on_error=False)
        outcome = command(*bound.args, **bound.kwargs)
        if inspect.isawaitable(outcome):
            _run_async(outcome)
        sys.stdout.flush()
    except (CycloptsError, UsageError) as error:
        return WRONG_USAGE, str(error)
    except RobotiqError as error:
        return FAILURE, str(error)
    except _SignalError as error:
        return error.code, str(error)
    except BrokenPipeError:
        # Whoever read the output has had enough (status | head); the flush at exit must not fail over it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return FAILURE, None
    except KeyboardInterrupt:
        return SIGNALLED + signal.SIGINT, "interrupted"
    return SUCCESS, None


def _run_async(work: Awaitable[None]) -> None:
    """Run to the end; SIGINT and SIGTERM cancel, so that leaving ``async with`` stops the fingers.

    Raises:
        _SignalError: one of them came.
    """
    received: list[int] = []

    async def cancellable() -> None:
        task = asyncio.current_task()
        assert task is not None
        with _handling(task.cancel, received):
            await work

    try:
        asyncio.run(cancellable())
    except asyncio.CancelledError:
        if not received:
            raise
        raise _SignalError(received[0]) from None


@contextmanager
def _handling(stop: Callable[[], object], received: list[int]) -> Iterator[None]:
    """Call ``stop`` in the running loop at the first signal; a second one has its ordinary effect."""
    loop = asyncio.get_running_loop()

    def handle(number: int, _frame: FrameType | None) -> None:
        restore()
        received.append(number)
        loop.call_soon_threadsafe(stop)

    def restore() -> None:
        for number, handler in previous.items():
            signal.signal(number, handler)

    # A SIGINT that is ignored stays so: that is how a shell keeps Ctrl-C from its background jobs.
    numbers = [n for n in (signal.SIGINT, signal.SIGTERM) if signal.getsignal(n) is not signal.SIG_IGN]
    previous = {number: signal.signal(number, handle) for number in numbers}
    try:
        yield
    finally:
        restore()
