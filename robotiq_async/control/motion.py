"""Moves: what was asked of which axes, when it has ended, and with what result."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from ..values.enums import AXES, STROKE_COUNTS, Finger
from ..values.errors import ConnectionLostError, RobotiqError
from ..values.move_result import MoveResult
from ..values.status import RobotiqStatus
from .waiters import Waiter, fail

MARGIN_S: Final = 2.0
"""Added to twice the expected time for the default timeout of a move."""


class Move:
    """One awaited move."""

    def __init__(self, position: int, axes: Finger, now: float, waiter: Waiter[MoveResult]) -> None:
        """Address axes.

        Args:
            position: target in counts.
            axes: the addressed axes.
            now: monotonic seconds of the call.
            waiter: gets the result, or the error.
        """
        self.position = position
        self.axes = axes
        self.was_lost = False
        """Whether the link went down under it."""
        self.write: int | None = None
        """The number of the write that carried it; None before that."""
        self._started = now
        self._waiter = waiter
        self._peak = dict.fromkeys((axis for axis in AXES if axis in axes), 0)

    def default_timeout(
        self, status: RobotiqStatus, speeds: Mapping[Finger, int], closing_time: Callable[[int], float]
    ) -> float:
        """Seconds it may take: twice the expected time plus 2 s.

        The expected time is that of the slowest addressed axis. The scissor has no published figure and is
        taken for a finger.

        Args:
            status: where the axes are.
            speeds: of every axis.
            closing_time: seconds of a full closing at a speed.
        """
        ways = {axis: abs(self.position - status.position(axis)) / STROKE_COUNTS for axis in self._peak}
        return 2 * max(way * closing_time(speeds[axis]) for axis, way in ways.items()) + MARGIN_S

    def see(self, status: RobotiqStatus) -> None:
        """Take in the currents of a status read after the command was sent."""
        for axis, peak in self._peak.items():
            self._peak[axis] = max(peak, status.current_ma(axis))

    def is_under(self, status: RobotiqStatus, limited: Mapping[Finger, int]) -> bool:
        """Whether a status echoes this request for every addressed axis, or the limit in place of it.

        Args:
            status: the newest one.
            limited: the axes for which the gripper shows a limit, with that.
        """
        return status.go_echo and all(
            status.requested_position(axis) == limited.get(axis, self.position) for axis in self._peak
        )

    def has_arrived(self, status: RobotiqStatus, arrived: Finger, limited: Mapping[Finger, int]) -> bool:
        """Whether a status shows every addressed axis at rest under this request, and it can be believed.

        Args:
            status: the newest one.
            arrived: the axes that are known to rest under what they were asked last.
            limited: the axes for which the gripper shows a limit, with that.
        """
        return self.axes in arrived and not status.moving & self.axes and self.is_under(status, limited)

    def end(self, status: RobotiqStatus) -> None:
        """Hand over the result, from the status that ended the move."""
        if not self._waiter.done():
            self._waiter.set_result(self._result(status))

    def fail(self, error: RobotiqError) -> None:
        """Hand over an error."""
        self.was_lost = isinstance(error, ConnectionLostError)
        fail([self._waiter], error)

    def _result(self, status: RobotiqStatus) -> MoveResult:
        return MoveResult(
            outcomes={axis: status.finger_status(axis) for axis in self._peak},
            positions={axis: status.position(axis) for axis in self._peak},
            contacts=status.contacts & self.axes,
            duration=status.timestamp - self._started,
            peak_current_ma=self._peak,
            status=status,
        )


class LiveMoves:
    """The moves under way. Each leaves once: it has arrived, it failed, or nobody waits for it any more."""

    def __init__(self) -> None:
        """Begin with none."""
        self._moves: list[Move] = []

    def __bool__(self) -> bool:
        """Whether there are any."""
        return bool(self._moves)

    def add(self, move: Move) -> None:
        """A move was asked for; it goes out with the next write."""
        self._moves.append(move)

    def remove(self, move: Move) -> bool:
        """Nobody waits for a move any more; returns whether it was under way."""
        if move not in self._moves:
            return False
        self._moves.remove(move)
        return True

    def written(self, number: int) -> None:
        """What was asked for has been written under this number."""
        for move in self._moves:
            if move.write is None:
                move.write = number

    def see(
        self,
        status: RobotiqStatus,
        acts: Callable[[int], bool],
        arrived: Finger,
        limited: Mapping[Finger, int],
    ) -> None:
        """End the moves that a status shows to have arrived, as far as their writes act.

        Args:
            status: the newest one.
            acts: whether the write of a number acts.
            arrived: the axes that are known to rest under what they were asked last.
            limited: the axes for which the gripper shows a limit in place of the request, with that.
        """
        for move in self._moves[:]:
            if move.write is None:
                continue
            move.see(status)
            if acts(move.write) and move.has_arrived(status, arrived, limited):
                self._moves.remove(move)
                move.end(status)

    def fail(self, error: RobotiqError, which: Callable[[Move], bool] = lambda _: True) -> None:
        """End those that an error is for."""
        failing = [move for move in self._moves if which(move)]
        self._moves = [move for move in self._moves if move not in failing]
        for move in failing:
            move.fail(error)
