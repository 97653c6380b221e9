"""Fingers: the axes that a client has set in motion, and the axes to hold because no client is there."""

from __future__ import annotations

from contextlib import suppress
from typing import Final

from ...local import RobotiqHand
from ...runtime import Limit, Log
from ...values import RUNNING, Finger, RobotiqConnectionError, RobotiqError

FINGERS_REST_S: Final = 0.5
"""Seconds for a hand that keeps its grip to come to rest, as long as a stop that keeps one gives it."""


class Fingers:
    """The axes of one hand, and for whom they move."""

    def __init__(self, hand: RobotiqHand, log: Log) -> None:
        self._hand = hand
        self._log = log
        self._commanded = Finger(0)  # by the holder of the lease: they are held when it ends
        self._to_hold = Finger(0)
        """To be held when the gripper is reached again: the link was down when they should have been."""

    def command(self, axes: Finger) -> None:
        """The holder of the lease sends axes to a position."""
        self._commanded |= axes

    def are_commanded(self, axes: Finger) -> None:
        """That command counts now: it replaces the hold that its axes still wait for."""
        self._to_hold &= ~axes

    def forget(self) -> Finger:
        """The lease has ended, or its holder leaves them; returns the axes that it has commanded."""
        commanded, self._commanded = self._commanded, Finger(0)
        return commanded

    async def hold(self, axes: Finger) -> None:
        self._to_hold &= ~axes
        try:
            await self._hand.hold(axes)
        except RobotiqConnectionError as error:
            self._to_hold |= axes
            self._log.warning("the fingers will be held when the gripper is reached: %s", error.message)
        except RobotiqError as error:
            self._log.warning("the fingers could not be held: %s", error.message)

    async def hold_as_due(self) -> None:
        """The gripper is reached: hold the axes that should have been held before."""
        if self._to_hold:
            await self.hold(self._to_hold)

    async def hold_what_moves(self) -> None:
        # The client that started the motion is gone: its agent was killed, for example.
        if self._hand.state in RUNNING and self._hand.is_moving:
            self._log.warning("the fingers moved when the agent started; they are held")
            with suppress(RobotiqConnectionError):
                await self._hand.hold(Finger.ALL)

    async def come_to_rest(self) -> bool:
        """Hold moving axes; whether all rest within FINGERS_REST_S while the event loop runs."""
        await self._hand.hold(Finger.ALL)
        with Limit(FINGERS_REST_S):
            async for _ in self._hand.statuses():
                if not self._hand.is_moving:
                    return True
        return False
