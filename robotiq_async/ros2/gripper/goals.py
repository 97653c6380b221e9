"""Goals of the gripper's action, one at a time, on any hand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ...hands import Hand
from ...runtime import Log, wait_shielded
from ...values import Finger, MoveResult, RobotiqConnectionError, RobotiqError
from ..translation.joints import Targets

FEEDBACK_S: Final = 0.05  # seconds between two feedbacks: 20 Hz


class GoalEnding(Enum):
    """The final state of a goal, as the actions of ROS name it."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class GoalOutcome:
    """The outcome of a goal."""

    ending: GoalEnding  # the final state of the goal
    stalled: bool  # whether a contact stopped at least one addressed axis
    reached: bool  # whether every addressed axis has reached its target
    reason: str  # for the log and the client


class _RunningGoal:
    def __init__(self, key: bytes) -> None:
        self.key = key
        self.work: asyncio.Task[Sequence[MoveResult]] | None = None
        self.ended: tuple[GoalEnding, str] | None = None
        """Final state and reason, if the goal was ended before its moves."""
        self.hold: asyncio.Future[str] | None = None
        """Done when the gripper has acknowledged the hold of its axes: empty, or why it has not."""
        self.is_over = asyncio.Event()  # set when the next goal may use its axes

    def begin(self, work: asyncio.Task[Sequence[MoveResult]]) -> None:
        self.work = work

    def hold_axes(self, hold: asyncio.Future[str]) -> None:
        self.hold = hold

    def end(self, ending: GoalEnding, reason: str) -> None:
        # The first reason counts. Its task then holds the axes that still move.
        if self.ended is None and not self.is_over.is_set():
            self.ended = ending, reason
            if self.work is not None:
                self.work.cancel()


class GoalRunner:
    """Carries out goals on a hand, one at a time. A new goal replaces the one before, and all its axes.

    ``lost`` is called with the axes of a goal that a lost link has ended: they may still move.
    """

    def __init__(self, hand: Hand, lost: Callable[[Finger], object] = lambda _: None) -> None:
        self._hand = hand
        self._lost = lost
        self._newest: _RunningGoal | None = None

    async def run(
        self,
        key: bytes,
        targets: Targets,
        *,
        speed: int,
        force: int,
        allow_stalling: bool,
        feedback: Callable[[], object] = lambda: None,
    ) -> GoalOutcome:
        """Move the axes of a goal until they stop or the goal is ended. If cancelled, hold them.

        ``key`` identifies the goal for :meth:`cancel`. With ``allow_stalling`` a contact is a success.
        ``feedback`` is called 20 times a second while the axes move.
        """
        goal, before = _RunningGoal(key), self._newest
        self._newest = goal
        if before is not None:
            before.end(GoalEnding.ABORTED, "another goal took over")
            # By then its holds have been passed to the hand, and the new targets replace them.
            try:
                await wait_shielded(asyncio.ensure_future(before.is_over.wait()))
            except asyncio.CancelledError:
                goal.is_over.set()
                raise
        try:
            results = await self._move_axes(goal, targets, speed, force, feedback)
        except RobotiqError as error:
            if isinstance(error, RobotiqConnectionError):
                self._lost(targets.axes)
            return GoalOutcome(GoalEnding.ABORTED, stalled=False, reached=False, reason=str(error))
        if results is None:
            assert goal.ended is not None
            ending, reason = goal.ended
            if goal.hold is not None and (problem := await goal.hold):
                # A canceled goal has its axes held, so a failed hold aborts it instead.
                ending, reason = GoalEnding.ABORTED, f"{reason}, but {problem}"
            return GoalOutcome(ending, stalled=False, reached=False, reason=reason)
        return _judge(results, allow_stalling=allow_stalling)

    def cancel(self, key: bytes) -> None:
        if self._newest is not None and self._newest.key == key:
            self._newest.end(GoalEnding.CANCELED, "canceled by its client")

    def abort(self, reason: str) -> None:
        if self._newest is not None:
            self._newest.end(GoalEnding.ABORTED, reason)

    async def _move_axes(
        self, goal: _RunningGoal, targets: Targets, speed: int, force: int, feedback: Callable[[], object]
    ) -> Sequence[MoveResult] | None:
        """The results of the moves; None if the goal was ended first."""
        try:
            if goal.ended is not None:
                return None
            work = asyncio.ensure_future(_move(self._hand, targets, speed, force))
            goal.begin(work)
            try:
                while not work.done():
                    await asyncio.wait({work}, timeout=FEEDBACK_S)
                    if not work.done():
                        feedback()
            finally:
                work.cancel()
                await asyncio.wait({work})
            # Moves that were done before the goal was ended count.
            if not work.cancelled():
                return work.result()
            if goal.ended is not None and goal.ended[0] is GoalEnding.CANCELED:
                # Now: a later hold would stop the axes of the next goal.
                goal.hold_axes(asyncio.ensure_future(self._hold_axes(goal, targets.axes)))
            return None
        finally:
            goal.is_over.set()

    async def _hold_axes(self, goal: _RunningGoal, axes: Finger) -> str:
        """Hold axes; returns why the gripper has not acknowledged it, empty if it has."""
        try:
            await self._hand.hold(axes)
        except RobotiqError as error:
            if self._newest is goal:  # otherwise the next goal moves them
                problem = f"the hold was not acknowledged: {error}"
                Log(self._hand.name).error("a goal was canceled, and %s", problem)
                return problem
        return ""


async def _move(hand: Hand, targets: Targets, speed: int, force: int) -> Sequence[MoveResult]:
    # Requests of one turn of the loop are written in one image, so all axes start together. A failure ends
    # all of them.
    moves = [
        asyncio.ensure_future(hand.move(position, axes, speed=speed, force=force))
        for position, axes in targets.counts
    ]
    try:
        return await asyncio.gather(*moves)
    finally:
        for move in moves:
            move.cancel()
        await asyncio.gather(*moves, return_exceptions=True)


def _judge(results: Sequence[MoveResult], *, allow_stalling: bool) -> GoalOutcome:
    touched = [str(result.contacts) for result in results if result.contacts]
    if not touched:
        return GoalOutcome(
            GoalEnding.SUCCEEDED, stalled=False, reached=True, reason="every axis reached its target"
        )
    ending = GoalEnding.SUCCEEDED if allow_stalling else GoalEnding.ABORTED
    return GoalOutcome(ending, stalled=True, reached=False, reason=f"contact: {'|'.join(touched)}")
