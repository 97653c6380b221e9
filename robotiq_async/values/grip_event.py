"""GripEvent: one thing that has become of a grip."""

from __future__ import annotations

from dataclasses import dataclass
from enum import Enum

from .enums import Finger
from .status import RobotiqStatus


class GripChange(Enum):
    """What can become of the grip of an axis."""

    GAINED = "gained"
    """The gripper reports a contact: a new one, or again after a slip."""
    SLIPPED = "slipped"
    """An axis in contact has moved: it went on closing, or was pushed."""
    LOST = "lost"
    """The gripper reports the contact no more, and nobody asked the axis to let go. A fault, a reset and a
    lost activation are told like this, too: whether the part is held is not known any more."""
    RELEASED = "released"
    """The contact has ended because of a request: to go the other way, or to stay where the axis stands."""


@dataclass(frozen=True, slots=True, repr=False)
class GripEvent:
    """One change of one axis's grip. A value: compared, hashed, copied, pickled.

    Attributes:
        change: what has become of it.
        finger: the axis.
        moved: counts that the axis has gone since its contact was made, or last slipped; above 0 closing.
        holds: the watched axes that are in contact after the status.
        status: the status that tells of it.
    """

    change: GripChange
    finger: Finger
    moved: int
    holds: Finger
    status: RobotiqStatus

    @property
    def position(self) -> int:
        """Where the axis is, in counts."""
        return self.status.position(self.finger)

    @property
    def timestamp(self) -> float:
        """Monotonic seconds of the status."""
        return self.status.timestamp

    def __repr__(self) -> str:
        """The words a person looks for first."""
        moved = f" by {self.moved:+d}" if self.moved else ""
        what = f"{self.finger} {self.change.name}{moved} at {self.position}"
        return f"<GripEvent {what}; contact of {self.holds}>"
