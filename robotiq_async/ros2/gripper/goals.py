"""Goals of the gripper's action, one at a time, on any hand."""

from __future__ import annotations

import asyncio
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from enum import Enum
from typing import Final

from ...hand import Hand
from ...runtime.log import Log
from ...values.enums import Finger
from ...values.errors import RobotiqConnectionError, RobotiqError
from ...values.move_result import MoveResult
from ..translation.joints import Targets

FEEDBACK_S: Final = 0.05
"""From one feedback to the next: 20 Hz."""


class Ending(Enum):
    """How a goal ended, in the words of ROS's actions."""

    SUCCEEDED = "succeeded"
    CANCELED = "canceled"
    ABORTED = "aborted"


@dataclass(frozen=True, slots=True)
class Outcome:
    """How a goal ended.

    Attributes:
        ending: the state that the goal ends in.
        stalled: whether a contact stopped at least one addressed axis.
        reached: whether every addressed axis is where it was asked to be.
        reason: in words.
    """

    ending: Ending
    stalled: bool
    reached: bool
    reason: str


class _Goal:
    """A goal under way."""

    def __init__(self, key: bytes) -> None:
        self.key = key
        self.work: asyncio.Task[Sequence[MoveResult]] | None = None
        self.ended: tuple[Ending, str] | None = None
        """How somebody else has ended it."""
        self.hold: asyncio.Future[str] | None = None
        """Done when its axes have been told to stay: empty, or why they have not been."""
        self.is_over = asyncio.Event()
        """Its axes belong to whoever comes next."""

    def end(self, ending: Ending, reason: str) -> None:
        """Give it up: axes that still move are held. The first reason counts."""
        if self.ended is None and not self.is_over.is_set():
            self.ended = ending, reason
            if self.work is not None:
                self.work.cancel()


class GoalRunner:
    """Carries out goals on a hand; a new one takes the place of the one before, all of its axes."""

    def __init__(self, hand: Hand, lost: Callable[[Finger], object] = lambda _: None) -> None:
        """Begin with none.

        Args:
            hand: the hand; it moves only while a goal is run.
            lost: is called with the axes of a goal that a lost link has ended: they may still move.
        """
        self._hand = hand
        self._lost = lost
        self._newest: _Goal | None = None

    async def run(
        self,
        key: bytes,
        targets: Targets,
        *,
        speed: int,
        force: int,
        allow_stalling: bool,
        feedback: Callable[[], object] = lambda: None,
    ) -> Outcome:
        """Move the axes of a goal until they have stopped, or until somebody ends the goal.

        When cancelled, those that still move are held.

        Args:
            key: which goal, for :meth:`cancel`.
            targets: where its axes go.
            speed: of its axes.
            force: of its axes.
            allow_stalling: whether a contact is a success.
            feedback: is called twenty times a second meanwhile.
        """
        goal, before = _Goal(key), self._newest
        self._newest = goal
        if before is not None:
            before.end(Ending.ABORTED, "another goal took over")
            # Its holds are left with the hand by then, and the new targets go over them.
            await before.is_over.wait()
        try:
            results = await self._moved(goal, targets, speed, force, feedback)
        except RobotiqError as error:
            if isinstance(error, RobotiqConnectionError):
                self._lost(targets.axes)
            return Outcome(Ending.ABORTED, stalled=False, reached=False, reason=str(error))
        if results is None:
            assert goal.ended is not None
            ending, reason = goal.ended
            if goal.hold is not None and (problem := await goal.hold):
                # Canceled would say that its axes are to stay.
                ending, reason = Ending.ABORTED, f"{reason}, but {problem}"
            return Outcome(ending, stalled=False, reached=False, reason=reason)
        return _judged(results, allow_stalling=allow_stalling)

    def cancel(self, key: bytes, reason: str = "canceled by its client") -> None:
        """End a goal for its client."""
        if self._newest is not None and self._newest.key == key:
            self._newest.end(Ending.CANCELED, reason)

    def abort(self, reason: str) -> None:
        """End whatever is under way, for a reason of our own."""
        if self._newest is not None:
            self._newest.end(Ending.ABORTED, reason)

    async def _moved(
        self, goal: _Goal, targets: Targets, speed: int, force: int, feedback: Callable[[], object]
    ) -> Sequence[MoveResult] | None:
        """How the moves of a goal ended; None if the goal was ended before.

        Raises:
            RobotiqError: a move failed.
        """
        try:
            if goal.ended is not None:
                return None
            goal.work = work = asyncio.ensure_future(_move(self._hand, targets, speed, force))
            try:
                while not work.done():
                    await asyncio.wait({work}, timeout=FEEDBACK_S)
                    if not work.done():
                        feedback()
            finally:
                work.cancel()
                await asyncio.wait({work})
            # What had arrived before it was ended has arrived.
            if not work.cancelled():
                return work.result()
            if goal.ended is not None and goal.ended[0] is Ending.CANCELED:
                # Asked for now: later it would hold what the next goal moves.
                goal.hold = asyncio.ensure_future(self._held(goal, targets.axes))
            return None
        finally:
            goal.is_over.set()

    async def _held(self, goal: _Goal, axes: Finger) -> str:
        """Wait until the gripper has acknowledged that axes are to stay; returns why it has not."""
        try:
            await self._hand.hold(axes)
        except RobotiqError as error:
            if self._newest is goal:  # or else the next goal has them
                problem = f"the hold was not acknowledged: {error}"
                Log(self._hand.name).error("a goal was canceled, and %s", problem)
                return problem
        return ""


async def _move(hand: Hand, targets: Targets, speed: int, force: int) -> Sequence[MoveResult]:
    """All at once, for what is asked for in one turn of the loop is one write; a failure ends the others."""
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


def _judged(results: Sequence[MoveResult], *, allow_stalling: bool) -> Outcome:
    touched = [str(result.contacts) for result in results if result.contacts]
    if not touched:
        return Outcome(Ending.SUCCEEDED, stalled=False, reached=True, reason="every axis is there")
    ending = Ending.SUCCEEDED if allow_stalling else Ending.ABORTED
    return Outcome(ending, stalled=True, reached=False, reason=f"contact: {'|'.join(touched)}")
