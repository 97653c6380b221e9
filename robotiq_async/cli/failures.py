"""Errors that end a command."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class UsageError(Exception):
    """The arguments are wrong: exit code 2."""


class CommandError(Exception):
    """The command failed, and not because of the gripper: exit code 1."""


@contextmanager
def usage() -> Iterator[None]:
    """Turn ValueError and TypeError of constructors into UsageError."""
    try:
        yield
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error
