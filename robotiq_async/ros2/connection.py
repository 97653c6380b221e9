"""What a configured node has: a hand, its goals and its commands. Runs in the event loop; knows no ROS."""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..actions import ACTIONS, Operator
from ..errors import RobotiqError
from ..log import Log
from ..protocol import Hand
from .goals import GoalRunner, Outcome
from .hands import why_not
from .joints import Targets
from .settings import Settings

COMMANDS: Final = ("activate", "reset", "halt", "recover", "release")
"""What the services are called, and the actions behind them."""
MOST_CALLS: Final = 16
"""Commands that may be under way at once; halts are no part of them, and never one too many."""


class RefusedError(RobotiqError):
    """The node does not carry out what it is asked now."""


class Connection:
    """A hand, from the configuration of the node to its cleanup.

    Attributes:
        hand: the hand.
        takes_commands: whether the node is active. A halt is taken whether or not it is.
    """

    def __init__(self, hand: Hand, settings: Settings) -> None:
        """Prepare; opens nothing. Belongs to the loop of the hand, but for what says otherwise.

        Args:
            hand: not started.
            settings: what the hand was made with.
        """
        self.hand = hand
        self.takes_commands = False
        self._operator = Operator(hand, speed=settings.speed, force=settings.force)
        self._goals = GoalRunner(hand)
        self._calls = 0
        self._took_commands = False

    async def open(self) -> None:
        """Connect and read; nothing is written to the gripper.

        Raises:
            RobotiqError: no gripper there, or a link that failed.
        """
        await self.hand.start(activate=False)

    async def permit(self) -> None:
        """Take commands from now on. Moves nothing."""
        self.takes_commands = self._took_commands = True

    async def forbid(self, reason: str) -> None:
        """Take no commands any more, and halt.

        A halt that does not reach the gripper is an error in the log and no failure: what matters is that
        nothing else is commanded.
        """
        self.takes_commands = False
        self._goals.abort(reason)
        try:
            await self._operator.act(ACTIONS["halt"])
        except RobotiqError as error:
            Log(self.hand.name).error("no halt, the fingers MAY STILL MOVE: %s", error)

    async def close(self, reason: str) -> None:
        """Disconnect; the fingers are stopped if commands were ever taken. Idempotent."""
        self.takes_commands = False
        self._goals.abort(reason)
        await self.hand.stop(halt=self._took_commands)

    async def command(self, name: str) -> str:
        """Carry out one of :data:`COMMANDS`; returns how it ended, in words.

        Raises:
            RefusedError: the node is not active, or too much is under way.
            RobotiqError: it could not be carried out.
        """
        if name == "halt":
            return await self._operator.act(ACTIONS[name])
        self._check_active()
        if self._calls >= MOST_CALLS:
            raise RefusedError(f"{MOST_CALLS} commands are under way")
        self._calls += 1
        try:
            return await self._operator.act(ACTIONS[name])
        finally:
            self._calls -= 1

    async def check_goal(self) -> None:
        """Refuse a goal that cannot be begun now.

        Raises:
            RefusedError: the node is not active, the link is down, or the gripper is in no state to move.
        """
        self._check_active()
        reason = why_not(self.hand)
        if reason is not None:
            raise RefusedError(reason)

    async def run_goal(
        self, key: bytes, targets: Targets, settings: Settings, feedback: Callable[[], object]
    ) -> Outcome:
        """Carry out a goal; see :meth:`GoalRunner.run`.

        Raises:
            RefusedError: as :meth:`check_goal`: things may have changed since.
        """
        await self.check_goal()
        return await self._goals.run(
            key,
            targets,
            speed=settings.speed,
            force=settings.force,
            allow_stalling=settings.allow_stalling,
            feedback=feedback,
        )

    def cancel_goal(self, key: bytes) -> None:
        """End a goal for its client."""
        self._goals.cancel(key)

    def _check_active(self) -> None:
        if not self.takes_commands:
            raise RefusedError("the node is not active: activate it first (that moves nothing)")
