"""What a position, a contact and a motion tell about the request that an axis follows."""

from __future__ import annotations

from typing import Final

from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.request import Request
from ..values.status import RobotiqStatus

TOLERANCE: Final = 2
"""Counts between a request and the position reached (manual: within 1-2)."""
OPEN_READING_MAX: Final = 7
"""An open finger reads 6-7 although 0 was asked."""
CLOSED_READING_MIN: Final = 240
"""A closed finger reads 240 or more although 255 was asked."""


def agrees(request: int, what: ObjectStatus, position: int, direction: int) -> bool:
    """Whether an axis could be doing what it does because of this request.

    Args:
        request: position request in counts.
        what: what the axis does.
        position: where it is, in counts.
        direction: above 0 closing, below 0 opening, 0 unknown; used only while it moves.
    """
    match what:
        case ObjectStatus.CONTACT_CLOSING:
            return request > position
        case ObjectStatus.CONTACT_OPENING:
            return request < position
        case ObjectStatus.IN_MOTION:
            return request != position and (direction == 0 or (request > position) == (direction > 0))
    if request <= OPEN_READING_MAX:
        return position <= OPEN_READING_MAX + TOLERANCE
    if request >= CLOSED_READING_MIN:
        return position >= CLOSED_READING_MIN - TOLERANCE
    return abs(request - position) <= TOLERANCE


def drifts(
    axis: Finger, base: Request, status: RobotiqStatus, arrived: Finger, doubtful: Finger = NO_AXES
) -> bool:
    """Whether an axis moves or is about to: then holding it means asking for where it is.

    An axis in contact keeps its request, and with it its grip; so does one that stands where it was asked
    to. What an axis does may still come from the request before this one: then the two disagree.

    Args:
        axis: the axis.
        base: the image that acts, or will in a moment.
        status: the newest status.
        arrived: the axes that have come to rest under their requests. Another one that is at rest close by
            may not have begun yet.
        doubtful: the axes that are shown at rest, and by what was asked a moment ago may move all the same.
    """
    if not base.go:
        return False
    if axis in doubtful:
        return base.position(axis) != status.position(axis)
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    if what is ObjectStatus.AT_POSITION and axis not in arrived:
        return request != position
    return what is ObjectStatus.IN_MOTION or not agrees(request, what, position, direction=0)
