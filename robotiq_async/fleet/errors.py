"""Errors of hands on other hosts, in addition to the errors of every hand.

::

    RobotiqStateError
    +-- ControlLostError        this hand does not hold the lease
    +-- NotAllowedError         the fleet's access rules forbid it
    RobotiqConnectionError
    +-- AgentError              the agent did not carry it out
    RobotiqError
    +-- NotAllStoppedError      the halt of a fleet; .outcomes, .unreached
"""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from typing import Any

from ..values import RobotiqConnectionError, RobotiqError, RobotiqStateError


class ControlLostError(RobotiqStateError):
    """This hand does not hold the lease that commands a gripper on another host, or no longer holds it.

    Attributes:
        reason: "held", "taken" or "halted" by another client, "expired" (not renewed in time), "released" by
            this hand, "restarted" (the agent was), "early" or "late" for one request, or "closed".
    """

    def __init__(self, message: str, reason: str) -> None:
        self.reason = reason
        super().__init__(message)


class NotAllowedError(RobotiqStateError):
    """The access rules of the fleet forbid this client the request."""


class AgentError(RobotiqConnectionError):
    """An agent on another host failed to carry out a request."""


class NotAllStoppedError(RobotiqError):
    """Not every gripper of a fleet was seen to stop: some MAY STILL MOVE.

    Attributes:
        outcomes: the outcome of each gripper's halt; "stopped" means seen to stop.
        unreached: endpoints without a connection; the grippers behind them are unknown.
    """

    def __init__(self, message: str, outcomes: Mapping[Any, str], unreached: Iterable[str] = ()) -> None:
        self.outcomes: dict[Any, str] = dict(outcomes)
        self.unreached: tuple[str, ...] = tuple(unreached)
        super().__init__(message)
