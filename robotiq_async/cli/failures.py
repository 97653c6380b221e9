"""Errors that end a command."""

from __future__ import annotations

import asyncio
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from pathlib import Path


class UsageError(Exception):
    """The arguments are wrong: exit code 2."""


class CommandError(Exception):
    """The command failed, and not because of the gripper: exit code 1."""


@contextmanager
def usage() -> Iterator[None]:
    """Turn ValueError and TypeError of constructors into UsageError, a missing extra into CommandError."""
    try:
        yield
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error
    except ImportError as error:
        raise CommandError(str(error)) from error


@contextmanager
def file_errors(file: Path) -> Iterator[None]:
    """Turn OSError into CommandError, which names the file."""
    try:
        yield
    except OSError as error:
        raise CommandError(f"{file}: {error.strerror}") from error


def normal_end() -> suppress:
    """Ignore the cancellation of commands that run until Ctrl-C."""
    return suppress(asyncio.CancelledError)
