"""The first motion on a new connection: does the gripper follow it, or only acknowledge it?

After a reconnect or an adoption a gripper may acknowledge and echo a motion without moving. One driver that
ran on a 3-Finger writes rACT on each new connection for this reason. The caller must get an error then: the
move would otherwise end far from its target, or at its timeout.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Final

from ..values.enums import NO_AXES, Finger
from ..values.model import TOLERANCE
from ..values.request import Request
from ..values.status import RobotiqStatus
from .contact import agrees
from .requests.limits import NEAR_PINCH
from .requests.standstill import LAG_READS, Moment

IGNORED_S: Final = 1.0
"""A motion that moves no finger for this long is ignored. At the slowest speed a finger moves 23 counts in
this time (thesis, table A1.1), and no object status is this late."""

NEAR_AN_END: Final = 20, 225
"""Scissor positions beyond which a software limit may lie (drivers keep within 15..232)."""
LIMITED_FINGER: Final = 100
"""A limited finger is at least this far closed: in pinch mode fingers stop at about 113 (manual)."""


class FirstMotion:
    """Watches the first motion from its write until an axis moves, or for IGNORED_S.

    Attributes:
        is_watched: whether the motion was written, and no axis has moved.
    """

    def __init__(self) -> None:
        self.is_watched = False
        self._is_due = False
        self._number = 0
        self._moved = NO_AXES
        self._from: dict[Finger, int] = {}
        self._since: Moment | None = None

    def connected(self) -> None:
        """An active gripper was found on a new connection."""
        self._is_due, self.is_watched = True, False

    def over(self) -> None:
        """Stop watching: the gripper follows, or a sequence has run."""
        self._is_due = self.is_watched = False

    def written(self, number: int, moved: Finger, status: RobotiqStatus) -> None:
        """A motion of some axes was written."""
        if not self._is_due or not moved:
            return
        if not self.is_watched:
            self._from = {axis: status.position(axis) for axis in status.model.axes}
            self._moved, self._since = NO_AXES, None
        self.is_watched, self._number = True, number
        self._moved |= moved

    def see(
        self, status: RobotiqStatus, base: Request, acts: Callable[[int], bool], now: Moment
    ) -> tuple[Finger, bool]:
        """Return the axes that do not follow, and whether this has lasted for IGNORED_S.

        ``base`` is the request in force; ``acts`` tells whether the write of a number acts.
        """
        if not base.go or any(abs(status.position(axis) - at) > TOLERANCE for axis, at in self._from.items()):
            self.over()
            return NO_AXES, False
        if self._since is None:
            self._since = now if acts(self._number) else None
            return self._moved, False
        still = Finger(sum(axis for axis in self._moved if _should_move(axis, status, base)))
        if not still:
            self.is_watched = False  # this one asked for no motion: the next one is the first
            return NO_AXES, False
        is_long = now.time - self._since.time >= IGNORED_S and now.reads - self._since.reads >= LAG_READS
        if is_long:
            self.is_watched = False
        return still, is_long


def _should_move(axis: Finger, status: RobotiqStatus, base: Request) -> bool:
    """Whether an axis is asked to be elsewhere, and no known contact or limit keeps it where it is."""
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    if what.is_contact and agrees(status.model, request, what, position, direction=0):
        return False
    return not status.model.has_reached(request, position) and not _may_be_limited(axis, request, status)


def _may_be_limited(axis: Finger, request: int, status: RobotiqStatus) -> bool:
    """Whether a software limit may keep an axis where it is. The gripper reports that as arrived."""
    if Finger.SCISSOR not in status.model.all_axes:
        return False
    position = status.position(axis)
    low, high = NEAR_AN_END
    if axis is Finger.SCISSOR:
        return (request < position <= low) or (request > position >= high)
    return status.position(Finger.SCISSOR) >= NEAR_PINCH and request > position >= LIMITED_FINGER
