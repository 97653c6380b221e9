"""Patience: calls that wait for the link, as copied drivers wait for their socket, and then raise."""

from __future__ import annotations

import time
from collections.abc import Callable
from contextlib import suppress
from typing import Final, TypeVar

from ..sync import RobotiqHand
from ..values import NotStartedError, RobotiqConnectionError, RobotiqStatus, check_seconds

T = TypeVar("T")
RECENT_STATUS_S: Final = (
    0.03  # a status of this age answers at once: a jaw moves up to 12 counts in that time
)
SHORTEST_S: Final = 0.01  # that a stream can be limited to


class CallerPatience:
    """The seconds, 0.05..3600, that calls of a started blocking hand wait while the link is down."""

    def __init__(
        self, hand: RobotiqHand, seconds: float, name: str = "seconds", fresh: float = RECENT_STATUS_S
    ) -> None:
        self._hand = hand
        self.seconds: float = check_seconds(name, seconds, 0.05, 3600.0)
        self._fresh = fresh

    def status(self, seconds: float | None = None) -> RobotiqStatus:
        """The newest status if it is fresh, else the next one. An older one is never the answer.

        Raises:
            ConnectionLostError: none came in time. An OSError.
            NotStartedError: the hand is not started, or was stopped meanwhile.
        """
        hand = self._hand
        with suppress(RobotiqConnectionError):
            hand.is_moving  # noqa: B018  # raises while the link is down
            if time.monotonic() - (status := hand.status).timestamp < self._fresh:
                return status
        for status in hand.statuses(lost_after=self.seconds if seconds is None else max(seconds, SHORTEST_S)):
            return status
        raise NotStartedError("the hand was stopped meanwhile")

    def call(self, function: Callable[[RobotiqHand], T], extra: float = 0.0) -> T:
        """The result of a call that means the same once the link is back; made again until then.

        Args:
            function: makes the call; its RobotiqConnectionError is waited out.
            extra: seconds that the call itself may take.
        """
        until = time.monotonic() + self.seconds + extra
        while True:
            self.status(min(self.seconds, until - time.monotonic()))
            try:
                return function(self._hand)
            except RobotiqConnectionError:
                if time.monotonic() > until:
                    raise
