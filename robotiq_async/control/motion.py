"""Awaited moves: their targets, when they have ended, and their results."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from ..runtime.log import Log, log
from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.errors import RobotiqError
from ..values.move_result import MoveResult
from ..values.status import RobotiqStatus
from .entry import Entry
from .ledger import Ledger
from .waiters import Waiter, fail

MARGIN_S: Final = 2.0
"""Added to twice the expected time for the default timeout of a move."""


class Move:
    """One awaited move to a position in counts."""

    def __init__(self, position: int, axes: Finger, now: float, waiter: Waiter[MoveResult]) -> None:
        self.position = position
        self.axes = axes
        self.left = axes  # those that may still follow it, although it may have failed
        self.entry: Entry | None = None
        self._started = now
        self._waiter = waiter
        self._peak = dict.fromkeys(axes, 0)

    def default_timeout(
        self, status: RobotiqStatus, speeds: Mapping[Finger, int], closing_time: Callable[[int], float]
    ) -> float:
        """Seconds it may take: twice the expected time of its slowest axis plus 2 s."""
        # ``closing_time`` gives the seconds of a full stroke at a speed. No time is published for the
        # scissor: it counts as a finger.
        full = status.model.stroke.counts
        strokes = {axis: abs(self.position - status.position(axis)) / full for axis in self._peak}
        # The times are those of one gripper without load [thesis, table A1.1]: twice leaves room.
        return 2 * max(stroke * closing_time(speeds[axis]) for axis, stroke in strokes.items()) + MARGIN_S

    def written(self, entry: Entry) -> None:
        self.entry = entry

    def note_currents(self, status: RobotiqStatus) -> None:
        for axis, peak in self._peak.items():
            self._peak[axis] = max(peak, status.current_ma(axis) or 0)

    def is_under(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> bool:
        """Whether a status echoes the target for every axis of the move, or the limit in place of it."""
        # rGTO = 0 echoes positions, too, and none of them is followed [manual 2014, pp. 50, 54].
        return status.go_echo and all(
            status.requested_position(axis) == limited.get(axis, self.position) for axis in self._peak
        )

    def has_arrived(self, status: RobotiqStatus, resting: Finger, limited: Mapping[Finger, int]) -> bool:
        """Whether a status shows the move ended; ``resting`` are the axes known to rest."""
        # An axis may be known to rest by its position, and move by its gDT, which is then from before.
        return self.axes in resting and not status.moving & self.axes and self.is_under(status, limited)

    def end(self, status: RobotiqStatus) -> MoveResult:
        reached = (axis for axis in self._peak if status.has_reached(axis, self.position))
        result = MoveResult(
            outcomes={axis: status.finger_status(axis) for axis in self._peak},
            positions={axis: status.position(axis) for axis in self._peak},
            contacts=status.contacts & self.axes,
            reached=Finger(sum(reached)),
            duration=status.timestamp - self._started,
            peak_current_ma={axis: peak if status.has_current else None for axis, peak in self._peak.items()},
            status=status,
        )
        self.left = NO_AXES
        if not self._waiter.done():
            self._waiter.set_result(result)
        return result

    def fail(self, error: RobotiqError, left: Finger = NO_AXES) -> None:
        """It has failed; only its axes in ``left`` still follow it. The first error counts."""
        self.left &= left
        fail([self._waiter], error)


class LiveMoves:
    """The moves that have not ended. Each leaves once: when it arrives or fails, or its caller gives up.

    A caller that gives up in the moment in which its move fails does not see the error, and counts on its
    axes to be held. So a failed move with axes that still follow it is kept until its caller has left.
    """

    def __init__(self, log: Log = log) -> None:
        self._moves: list[Move] = []
        self._failed: list[Move] = []
        self._log = log
        self._has_warned = False

    def __bool__(self) -> bool:
        return bool(self._moves or self._failed)

    def add(self, move: Move) -> None:
        self._moves.append(move)

    def remove(self, move: Move) -> bool:
        """Remove a move whose caller has left; return whether it had not ended."""
        is_live = move in self._moves
        for moves in (self._moves, self._failed):
            if move in moves:
                moves.remove(move)
        return is_live

    def written(self, entry: Entry) -> None:
        for move in self._moves:
            if move.entry is None:
                move.written(entry)

    def end_arrived(self, status: RobotiqStatus, ledger: Ledger) -> None:
        for move in self._moves[:]:
            if move.entry is None:
                continue
            move.note_currents(status)
            if ledger.acts(move.entry) and move.has_arrived(status, ledger.resting, ledger.limits.limited):
                self._moves.remove(move)
                self._warn_of_unreached(move, move.end(status), ledger.limits.limited)

    def _warn_of_unreached(self, move: Move, result: MoveResult, limited: Mapping[Finger, int]) -> None:
        """Warn once if a gripper shows "at position" and stands far from where it was asked to go."""
        # Not of the scissor: its range ends within 15..232 (drivers), and programs ask it for 0 and 255.
        for axis, how in result.outcomes.items():
            is_there = axis in result.reached or axis in limited or axis is Finger.SCISSOR
            if self._has_warned or is_there or how is not ObjectStatus.AT_POSITION:
                continue
            self._has_warned = True
            self._log.warning(
                "%s was asked for %d, and the gripper says that it is at position, at %d: it ends there (a "
                "software limit, fingertips of your own), or it did not follow. See MoveResult.reached; "
                "logged once",
                axis,
                move.position,
                result.positions[axis],
            )

    def take_over(self, axes: Finger, error: RobotiqError) -> None:
        """Fail the moves of these axes, which something else has taken over. Their other axes still move."""
        self.fail(error, lambda move: bool(move.axes & axes), left=~axes)

    def fail(
        self, error: RobotiqError, which: Callable[[Move], bool] = lambda _: True, *, left: Finger = NO_AXES
    ) -> None:
        """Fail the moves for which ``which`` is true. Only axes in ``left`` still follow a failed move."""
        failed = [*self._failed, *(move for move in self._moves if which(move))]
        self._moves = [move for move in self._moves if move not in failed]
        for move in failed:
            move.fail(error, left)
        self._failed = [move for move in failed if move.left]
