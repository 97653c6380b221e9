"""GripEvent: a grip gained, slipped, lost or released."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .enums import Finger
from .status import RobotiqStatus


class GripChange(Enum):
    """How the grip of an axis can change."""

    GAINED = "gained"
    """The gripper reports a contact: a new one, or again after a slip."""
    SLIPPED = "slipped"
    """An axis in contact has moved: it went on closing, or was pushed."""
    LOST = "lost"
    """The gripper stopped reporting the contact although the axis was not asked to let go. A fault, a reset
    and a lost activation also count as LOST: whether the part is still held is then unknown."""
    RELEASED = "released"
    """A request ended the contact: to move the other way, or to stay at the present position."""


@dataclass(frozen=True, slots=True, repr=False)
class GripEvent:
    """One change in the grip of one axis. Immutable; can be compared, hashed, copied and pickled.

    Attributes:
        change: the kind of change.
        finger: the axis.
        moved: counts the axis has moved since its contact or its last slip; positive means closing.
        holds: the watched axes that are in contact in this status.
        status: the status that shows the change.
    """

    change: GripChange
    finger: Finger
    moved: int
    holds: Finger
    status: RobotiqStatus

    @property
    def position(self) -> int:
        """The position of the axis, in counts."""
        return self.status.position(self.finger)

    @property
    def timestamp(self) -> float:
        """Monotonic seconds of the status."""
        return self.status.timestamp

    def __repr__(self) -> str:
        moved = f" by {self.moved:+d}" if self.moved else ""
        what = f"{self.finger} {self.change.name}{moved} at {self.position}"
        return f"<GripEvent {what}; contact of {self.holds}>"
