"""How a command says that it does not go on."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager


class UsageError(Exception):
    """The command line asks for something that does not exist: exit code 2."""


class CommandError(Exception):
    """A command cannot do what it is asked, and it is not the gripper's fault: exit code 1."""


@contextmanager
def usage() -> Iterator[None]:
    """Around the construction of library objects: a value they refuse is wrong usage.

    Raises:
        UsageError: in place of ValueError and TypeError.
    """
    try:
        yield
    except (ValueError, TypeError) as error:
        raise UsageError(str(error)) from error
