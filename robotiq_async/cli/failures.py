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
    """Turn errors of constructors into wrong usage.

    Raises:
        UsageError: in place of ValueError and TypeError.
    """
    try:
        yield
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error
