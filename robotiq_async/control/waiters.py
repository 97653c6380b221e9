"""Callers that wait: their answers, which an ``asyncio.Future`` takes, and the end of a move."""

from __future__ import annotations

import copy
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeVar

from ..values.enums import NO_AXES, Finger
from ..values.errors import RobotiqError
from ..values.move_result import MoveResult
from ..values.status import RobotiqStatus
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
    axes: Finger = NO_AXES  # the axes that it moves
    held: Finger = NO_AXES  # the axes that it holds, also if another client moves them
    halts: bool = False  # it waits for the end of a halt
    entry: Entry | None = None  # the write with its request

    def written(self, entry: Entry) -> None:
        self.entry = entry


class Move(Call):
    """One awaited move to a position in counts. Its caller waits until all its axes have arrived."""

    def __init__(self, position: int, axes: Finger, now: float, waiter: Waiter[MoveResult]) -> None:
        super().__init__(waiter, axes)
        self.position: Final = position
        self._started: Final = now
        self._peak: Final = dict.fromkeys(axes, 0)

    def is_under(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> bool:
        """Whether a status echoes the target for every axis of the move, or the limit instead."""
        # rGTO = 0 echoes positions, too, and none of them is followed [manual 2014, pp. 50, 54].
        return status.go_echo and all(
            status.requested_position(axis) == limited.get(axis, self.position) for axis in self.axes
        )

    def see(self, status: RobotiqStatus, unrested: Finger, limited: Mapping[Finger, int]) -> bool:
        """Take in a status; return whether it ends the move. An ``unrested`` axis may still move."""
        for axis, peak in self._peak.items():
            self._peak[axis] = max(peak, status.current_ma(axis) or 0)
        # An axis may be known to rest by its position, and move by its gDT, which is then from before.
        may_move = self.axes & unrested or self.axes & status.moving
        return not may_move and self.is_under(status, limited)

    def end(self, status: RobotiqStatus) -> None:
        if self.waiter.done():
            return
        result = MoveResult(
            outcomes={axis: status.finger_status(axis) for axis in self.axes},
            positions={axis: status.position(axis) for axis in self.axes},
            contacts=status.contacts & self.axes,
            reached=Finger(sum(axis for axis in self.axes if status.has_reached(axis, self.position))),
            duration=status.timestamp - self._started,
            peak_current_ma={axis: peak if status.has_current else None for axis, peak in self._peak.items()},
            status=status,
        )
        self.waiter.set_result(result)


def resolve(waiters: Iterable[Waiter[None]]) -> None:
    for waiter in waiters:
        if not waiter.done():
            waiter.set_result(None)


def fail(waiters: Iterable[Waiter[Any]], error: RobotiqError) -> None:
    """Give each caller a separate error: a raised error collects the traceback of its caller."""
    for waiter in waiters:
        if not waiter.done():
            copied = copy.copy(error)
            copied.__cause__ = error.__cause__  # which copy leaves out
            waiter.set_exception(copied)
