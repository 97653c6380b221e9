"""One entry of the ledger, and an activation or a release that one may have begun."""

from __future__ import annotations

from dataclasses import dataclass
from typing import NamedTuple

from ..values.enums import NO_AXES, Finger
from ..values.registers import Echo
from ..values.request import Request
from ..values.status import RobotiqStatus


@dataclass(slots=True, eq=False)
class Entry:
    """One image that the gripper has, had, or may get."""

    image: Request
    echo: Echo
    is_ours: bool
    sent: float  # monotonic seconds; of a write lost with the link the latest at which it may have arrived
    acknowledged: float | None = None  # when; None before that
    is_doubtful: bool = False  # whether it may act late, or never
    is_early: bool = False  # it came within write_spacing of another: the gripper may forget it
    held: Finger = NO_AXES  # the axes that it is to hold

    @property
    def time(self) -> float:
        return self.sent if self.acknowledged is None else self.acknowledged

    @property
    def is_on_the_line(self) -> bool:
        """Whether it is neither acknowledged nor lost."""
        return self.acknowledged is None and not self.is_doubtful

    def hold(self, axes: Finger) -> None:
        """Note axes that its callers count as held once it acts."""
        self.held |= axes

    def acknowledge(self, now: float) -> None:
        self.acknowledged = now

    def doubt(self, now: float) -> None:
        """Note that the link went down before it showed, or that another client's image shows."""
        if self.acknowledged is None:
            self.sent = max(self.sent, now)
        self.is_doubtful = True

    def believe(self, now: float) -> None:
        """Note that its echo shows, so it acts: the echo is its acknowledgement if none came."""
        self.acknowledged, self.is_doubtful = self.acknowledged or now, False

    def correct(self, image: Request, echo: Echo) -> None:
        """Take in its true image from a status: another client's requests, or limits instead of ours."""
        self.image, self.echo = image, echo


class Begun(NamedTuple):
    """An activation or a release that our write has begun, or may have begun: stopping the hand ends it.

    Another client may reset the gripper just before one of our writes. Then the rACT of this write rises, and
    begins an activation that nobody requested [follows]. An emergency stop shows the same [seen], and moves
    nothing.
    """

    entry: Entry
    first: RobotiqStatus | None = None  # the first status, if nobody requested it
