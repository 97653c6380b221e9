"""Awaited moves: their targets, when they have ended, and their results."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from ..values.enums import Finger
from ..values.move_result import MoveResult
from ..values.status import RobotiqStatus
from .waiters import Call, Waiter


class Move(Call):
    """One awaited move to a position in counts. Its caller waits until all its axes have arrived."""

    def __init__(self, position: int, axes: Finger, now: float, waiter: Waiter[MoveResult]) -> None:
        super().__init__(waiter, axes)
        self.position: Final = position
        self._started: Final = now
        self._peak: Final = dict.fromkeys(axes, 0)

    def is_under(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> bool:
        """Whether a status echoes the target for every axis of the move, or the limit in place of it."""
        # rGTO = 0 echoes positions, too, and none of them is followed [manual 2014, pp. 50, 54].
        return status.go_echo and all(
            status.requested_position(axis) == limited.get(axis, self.position) for axis in self.axes
        )

    def see(self, status: RobotiqStatus, unrested: Finger, limited: Mapping[Finger, int]) -> bool:
        """Take in a status; whether it shows the move ended, unless its axes are ``unrested``."""
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
