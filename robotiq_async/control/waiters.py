"""Answers to callers: a protocol that ``asyncio.Future`` satisfies."""

from __future__ import annotations

import copy
from collections.abc import Iterable
from typing import Any, Protocol, TypeVar

from ..values.errors import RobotiqError

T_contra = TypeVar("T_contra", contravariant=True)


class Waiter(Protocol[T_contra]):
    """The answer to one caller. It is done, too, once the caller has given up, and waits for one request."""

    def done(self) -> bool: ...

    def set_result(self, result: T_contra, /) -> None: ...

    def set_exception(self, exception: RobotiqError, /) -> None: ...


def resolve(waiters: Iterable[Waiter[None]]) -> None:
    for waiter in waiters:
        if not waiter.done():
            waiter.set_result(None)


def fail(waiters: Iterable[Waiter[Any]], error: RobotiqError) -> None:
    """Give each caller an error of its own: a raised error collects the traceback of its caller."""
    for waiter in waiters:
        if not waiter.done():
            copied = copy.copy(error)
            copied.__cause__ = error.__cause__  # which copy leaves out
            waiter.set_exception(copied)
