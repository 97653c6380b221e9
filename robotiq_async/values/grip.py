"""GraspResult: whether a closing has grasped a part. GripEvent: a grip gained, slipped, lost or released."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from enum import Enum
from typing import Any

from .checks import check_int
from .enums import JAW, Finger, ObjectStatus, names_of
from .move_result import MoveResult
from .status import RobotiqStatus


def check_at_least(at_least: object, fingers: Finger) -> int:
    """The number of contacts that make a grasp: 1 to the number of axes; None means all of them."""
    every = fingers.bit_count()
    return every if at_least is None else check_int("at_least", at_least, 1, every)


@dataclass(frozen=True, slots=True, repr=False)
class GraspResult:
    """The result of a grasp. True if the part is held; too few contacts are a result, not an error.

    Immutable; can be compared, hashed, copied and pickled.

    Attributes:
        move: the result of the closing: outcome and highest current of each addressed axis, duration.
        at_least: the number of contacts that make a grasp.
    """

    move: MoveResult
    at_least: int

    @property
    def holds(self) -> Finger:
        """The axes that a contact stopped while closing; empty if there was nothing to hold."""
        closing = ObjectStatus.CONTACT_CLOSING
        return Finger(sum(axis for axis, how in self.move.outcomes.items() if how is closing))

    @property
    def is_held(self) -> bool:
        """Whether enough axes hold."""
        return self.holds.bit_count() >= self.at_least

    @property
    def width_mm(self) -> float | None:
        """The width of the part between a jaw's fingertips; None if none is held, and for a 3-Finger.

        In millimetres: nominal, unless the hand has measured points.
        """
        is_jaw = len(self.status.model.axes) == 1
        return self.move.opening_mm(JAW) if self.is_held and is_jaw else None

    @property
    def positions(self) -> Mapping[Finger, int]:
        """The final position of each addressed axis, in counts; ``hand.units.mm()`` converts."""
        return self.move.positions

    @property
    def status(self) -> RobotiqStatus:
        """The status that ended the grasp: ``hand.grip_events(since=result.status)`` continues from there."""
        return self.move.status

    def as_dict(self) -> dict[str, Any]:
        """The result in types that JSON and pandas accept; the key ``move`` holds the result of the closing.

        A value of None is left out.
        """
        return {
            "is_held": self.is_held,
            "holds": names_of(self.holds),
            **({} if self.width_mm is None else {"width_mm": self.width_mm}),
            "at_least": self.at_least,
            "move": self.move.as_dict(),
        }

    def __bool__(self) -> bool:
        return self.is_held

    def __repr__(self) -> str:
        what = "held" if self.is_held else "not held"
        where = ", ".join(f"{axis}={position}" for axis, position in self.positions.items())
        width = "" if self.width_mm is None else f", {self.width_mm:.1f} mm wide"
        return f"<GraspResult {what}: contact of {self.holds}, {self.at_least} needed; {where}{width}>"


class GripChange(Enum):
    """A kind of change in the grip of an axis."""

    GAINED = "gained"
    """The gripper reports a contact: a new one, or again after a slip."""
    SLIPPED = "slipped"
    """An axis in contact has moved: it closed further, or was pushed."""
    LOST = "lost"
    """The gripper stopped reporting the contact although no request released it. A fault, a reset
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
        status: the status with the change.
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

    def as_dict(self) -> dict[str, Any]:
        """The event in types that JSON and pandas accept; change and axis by name."""
        return {
            "timestamp": self.timestamp,
            "change": self.change.name,
            "finger": str(self.finger.name),
            "position": self.position,
            "moved": self.moved,
            "holds": names_of(self.holds),
            "status": self.status.as_dict(),
        }

    def __repr__(self) -> str:
        moved = f" by {self.moved:+d}" if self.moved else ""
        what = f"{self.finger} {self.change.name}{moved} at {self.position}"
        return f"<GripEvent {what}; contact of {self.holds}>"
