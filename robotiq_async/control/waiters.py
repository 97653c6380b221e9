"""Answers to callers: a protocol that ``asyncio.Future`` satisfies, and what each caller waits for."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from typing import Any, Protocol, TypeVar

from ..values.enums import NO_AXES, Finger
from ..values.errors import RobotiqError
from .entry import Entry

T_contra = TypeVar("T_contra", contravariant=True)


class Waiter(Protocol[T_contra]):
    """The answer to one caller, of one request. It is done, too, once the caller has given up."""

    def done(self) -> bool: ...

    def set_result(self, result: T_contra, /) -> None: ...

    def set_exception(self, exception: RobotiqError, /) -> None: ...


AnswerCallers = Callable[[Iterable[Waiter[Any]], RobotiqError], None]
"""Takes callers that have ended, and the error for each of them."""


@dataclass(slots=True, eq=False)
class Call:
    """A caller that waits: for the acknowledgement of a command or a hold, or the end of a move or a halt."""

    waiter: Waiter[Any]
    axes: Finger = NO_AXES  # those that it moves
    held: Finger = NO_AXES  # those that it has named to be held: they are, whichever client moves them
    halts: bool = False  # it waits for the end of a halt
    entry: Entry | None = None  # the write that has what it asked for

    def written(self, entry: Entry) -> None:
        self.entry = entry

    def was_written_by(self, time: float) -> bool:
        return self.entry is not None and self.entry.time <= time


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
