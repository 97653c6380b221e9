"""GripWatch: derives grip events from statuses."""

# Theory of operation
#
# Each watched axis has a grip (_Grip) or none. see() alone changes that, from one status to the next:
#
#   none              the axis reports a contact                                   GAINED, in contact
#   in contact        it has moved further than a slip                             SLIPPED; slipping while it
#                                                                                  reports no contact
#   slipping          it reports the same contact again                            GAINED, in contact
#   either of both    the contact is gone, and the axis does not move under        RELEASED or LOST, none;
#                     a request beyond it                                          then perhaps GAINED
#
# RELEASED needs a proof: an active gripper with gGTO = 1 and no serious fault follows a request that is not
# beyond the contact. Besides, an earlier one was, or the axis has left the part. All else is LOST.
#
# Three things in a status mislead. gDT may trail the echo: a released axis moves before its contact ends,
# and that is no slip. A contact latches: a part that is taken out is noticed once its finger moves. Fault
# 0x09 may pass in a second (Evidence); until then the status is judged without it.

from __future__ import annotations

from dataclasses import dataclass
from typing import Final

from ..control.evidence import Evidence
from ..control.rest import agrees
from ..values.checks import check_int, check_mask, repr_of
from ..values.enums import Finger, ObjectStatus
from ..values.grip import GripChange, GripEvent
from ..values.model import Model
from ..values.status import RobotiqStatus

SLIP_COUNTS: Final = 3
"""Counts that an axis in contact may move without an event: more than the 2 by which positions and requests
differ (manual). No slip has been measured on real hardware."""

LATE_GRIP_S: Final = 1.0
"""A status that is older than the last one by more than this is from another clock."""


@dataclass(slots=True)
class _Grip:
    """The contact of one axis.

    Attributes:
        contact: its kind, while closing or while opening.
        touched: the position at which it was made.
        position: the same, or the position to which the axis has slipped since.
        was_pressed: whether a request beyond it was ever echoed. Under simple control the echo of an axis may
            mean nothing, and then its contact cannot be seen to be released.
        is_slipping: whether the axis has moved on and reports no contact yet.
    """

    contact: ObjectStatus
    touched: int
    position: int
    was_pressed: bool = False
    is_slipping: bool = False

    def note_request(self, model: Model, request: int) -> bool:
        """Note a request; whether it lies beyond the contact, so that the axis presses."""
        is_pressed = agrees(model, request, self.contact, self.touched, direction=0)
        self.was_pressed |= is_pressed
        return is_pressed

    def slip(self, position: int, *, is_touching: bool) -> None:
        self.position, self.is_slipping = position, not is_touching

    def is_left(self, moved: int) -> bool:
        """Whether an axis that has moved by this many counts has left the part."""
        return moved < 0 if self.contact is ObjectStatus.CONTACT_CLOSING else moved > 0


class GripWatch:
    """Follows the grips of some axes from status to status.

    A contact lasts until the gripper reports something else. When the force is raised, an axis in contact
    moves briefly under the same request: its contact ends only if it moves further than a slip.

    Args:
        fingers: the axes.
        since: the status to begin with; its contacts give no events. None for the first status seen.
        slip: counts that an axis in contact may move without an event, 1..255.

    Raises:
        TypeError, ValueError: an argument of the wrong type or outside its range.
    """

    def __init__(
        self,
        fingers: Finger | int = Finger.ABC,
        *,
        since: RobotiqStatus | None = None,
        slip: int = SLIP_COUNTS,
    ) -> None:
        self._axes = check_mask(fingers)
        self._slip = check_int("slip", slip, 1, 255)
        if since is not None and not isinstance(since, RobotiqStatus):
            raise TypeError(f"since must be None or a RobotiqStatus, got {repr_of(since)}")
        self._grips: dict[Finger, _Grip] = {}
        self._last: RobotiqStatus | None = None
        self._evidence = Evidence()
        if since is not None:
            self.see(since)

    @property
    def holds(self) -> Finger:
        """The axes in contact that do not slip."""
        return Finger(sum(axis for axis, grip in self._grips.items() if not grip.is_slipping))

    def see(self, status: RobotiqStatus) -> list[GripEvent]:
        """Return the events that a status brings.

        A status older than the last one is late and ignored. If it is older by LATE_S or more, the clock has
        changed: it counts, or the watch would report nothing until the old time is reached again.
        """
        last = self._last
        if last is not None and 0 < last.timestamp - status.timestamp < LATE_GRIP_S:
            return []
        self._last = status
        judged = self._evidence.judged(status, status.timestamp)
        axes = self._axes & status.model.all_axes
        changes = [(axis, *change) for axis in axes for change in self._changes(axis, judged)]
        if last is None:
            return []
        return [GripEvent(change, axis, moved, self.holds, status) for axis, change, moved in changes]

    def _changes(self, axis: Finger, status: RobotiqStatus) -> list[tuple[GripChange, int]]:
        """The changes of one axis in their order, each with the counts that it has moved."""
        grip = self._grips.get(axis)
        if grip is None:
            return self._gain(axis, status)
        is_touching = _contact(axis, status) is grip.contact
        if is_touching and grip.is_slipping:
            return self._gain(axis, status)
        is_pressed = grip.note_request(status.model, status.requested_position(axis))
        lets_go = not is_pressed and _follows_requests(status)
        moved = status.position(axis) - grip.position
        if is_touching or (is_pressed and _moves(axis, status)):
            # gDT may trail the echo: an axis that a request releases moves before its contact ends.
            is_leaving = lets_go and grip.was_pressed
            if grip.is_slipping or is_leaving or abs(moved) <= self._slip:
                return []
            grip.slip(status.position(axis), is_touching=is_touching)
            return [(GripChange.SLIPPED, moved)]
        del self._grips[axis]
        is_released = lets_go and (grip.was_pressed or grip.is_left(moved))
        change = GripChange.RELEASED if is_released else GripChange.LOST
        return [(change, moved), *self._gain(axis, status)]

    def _gain(self, axis: Finger, status: RobotiqStatus) -> list[tuple[GripChange, int]]:
        contact, position = _contact(axis, status), status.position(axis)
        if contact is None:
            return []
        self._grips[axis] = grip = _Grip(contact, position, position)
        grip.note_request(status.model, status.requested_position(axis))
        return [(GripChange.GAINED, 0)]


def _contact(axis: Finger, status: RobotiqStatus) -> ObjectStatus | None:
    """The contact that an axis reports; None also while the gripper is not active."""
    what = status.finger_status(axis)
    return what if what.is_contact and status.is_activated else None


def _moves(axis: Finger, status: RobotiqStatus) -> bool:
    """Whether an axis moves. In a fault it reports motion and is at rest."""
    return axis in status.moving and not status.fault.is_serious


def _follows_requests(status: RobotiqStatus) -> bool:
    return status.is_activated and status.go_echo and not status.fault.is_serious
