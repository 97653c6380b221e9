"""The first motion on a new connection: whether the gripper follows it, or only says so.

After a reconnect or an adoption a gripper may acknowledge a motion, echo it and move nothing: one driver
that ran on a 3-Finger writes rACT anew on each connection because of that. Without a word the move would end
far from its request, or when its time is over.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..values.enums import AXES, NO_AXES, Finger, ObjectStatus
from ..values.request import Request
from ..values.status import RobotiqStatus
from .contact import TOLERANCE, agrees
from .requests.limits import NEAR_PINCH
from .requests.standstill import LAG_READS, Moment

IGNORED_S: Final = 1.0
"""What has moved no finger for so long is ignored: at the slowest speed it takes 23 counts (thesis, table
A1.1), and an object status has come by then."""

NEAR_AN_END: Final = 20, 225
"""Scissor readings beyond which a software limit may be (drivers keep within 15..232)."""
LIMITED_FINGER: Final = 100
"""A limited finger is not further open than this: in pinch they stop at about 113 (manual)."""


class FirstMotion:
    """Watches it from its write until something has moved, or nothing has for long enough."""

    def __init__(self) -> None:
        """There is no connection."""
        self.is_watched = False
        """Whether it was written, and nothing has moved."""
        self._is_due = False
        self._number = 0
        self._moved = NO_AXES
        self._from: dict[Finger, int] = {}
        self._since: Moment | None = None

    def connected(self) -> None:
        """A gripper that is active was found on a new connection."""
        self._is_due, self.is_watched = True, False

    def over(self) -> None:
        """It follows what we ask; or it was asked something else."""
        self._is_due = self.is_watched = False

    def written(self, number: int, moved: Finger, status: RobotiqStatus) -> None:
        """A motion of some axes was written."""
        if not self._is_due or not moved:
            return
        if not self.is_watched:
            self._from = {axis: status.position(axis) for axis in AXES}
            self._moved, self._since = NO_AXES, None
        self.is_watched, self._number = True, number
        self._moved |= moved

    def see(
        self, status: RobotiqStatus, base: Request, acts: Callable[[int], bool], now: Moment
    ) -> tuple[Finger, bool]:
        """The axes that do not follow, and whether that has lasted.

        Args:
            status: the newest.
            base: what the gripper has been asked.
            acts: whether the write of a number acts.
            now: when the status was asked for.
        """
        if not base.go or any(abs(status.position(axis) - at) > TOLERANCE for axis, at in self._from.items()):
            self.over()
            return NO_AXES, False
        if self._since is None:
            self._since = now if acts(self._number) else None
            return self._moved, False
        still = Finger(sum(axis for axis in AXES if axis in self._moved and _should_move(axis, status, base)))
        if not still:
            self.is_watched = False  # it was asked for nothing: the next one is the first
            return NO_AXES, False
        is_long = now.time - self._since.time >= IGNORED_S and now.reads - self._since.reads >= LAG_READS
        if is_long:
            self.is_watched = False
        return still, is_long


def _should_move(axis: Finger, status: RobotiqStatus, base: Request) -> bool:
    """Whether an axis is asked to be somewhere else, and nothing that is known keeps it from that."""
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    if what.is_contact and agrees(request, what, position, direction=0):
        return False
    return not agrees(request, ObjectStatus.AT_POSITION, position, direction=0) and not _may_be_limited(
        axis, request, status
    )


def _may_be_limited(axis: Finger, request: int, status: RobotiqStatus) -> bool:
    """Whether a software limit may keep an axis where it is, which the gripper reports as reached."""
    position = status.position(axis)
    low, high = NEAR_AN_END
    if axis is Finger.SCISSOR:
        return (request < position <= low) or (request > position >= high)
    return status.position(Finger.SCISSOR) >= NEAR_PINCH and request > position >= LIMITED_FINGER
