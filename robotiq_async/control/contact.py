"""Requests that an axis may be following, by its position, contact and motion."""

from __future__ import annotations

from ..values.enums import NO_AXES, Finger, ObjectStatus
from ..values.model import Model
from ..values.request import Request
from ..values.status import RobotiqStatus


def agrees(model: Model, request: int, what: ObjectStatus, position: int, direction: int) -> bool:
    """Whether what an axis shows at a position can result from a request; positions are in counts.

    ``direction`` is above 0 closing, below 0 opening, 0 unknown; it is used only while the axis moves.
    """
    # gDT says that an axis has stopped before its request, and in which direction it was going [manual 2014,
    # p. 51; 2018, p. 39]. One at its request may be off by the model's tolerance [manual: up to 2 counts].
    match what:
        case ObjectStatus.CONTACT_CLOSING:
            return request > position
        case ObjectStatus.CONTACT_OPENING:
            return request < position
        case ObjectStatus.IN_MOTION:
            return request != position and (direction == 0 or (request > position) == (direction > 0))
    return model.has_reached(request, position)


def drifts(axis: Finger, base: Request, status: RobotiqStatus, may_move: Finger = NO_AXES) -> bool:
    """Whether an axis moves or is about to, so that a hold must ask for its present position.

    An axis in contact keeps its request, and with it its grip; so does one at rest where it was asked to be.
    An axis may still show what the request before this one made it do: then the two disagree.
    ``may_move`` has the axes that show rest, and may move because of an earlier request.
    """
    if not base.go:
        return False  # rGTO = 0 stops every axis [manual 2014, p. 50]
    # A needless hold would cost an axis in contact its grip: it would be asked for where it is.
    if axis in may_move:
        return base.position(axis) != status.position(axis)
    what, position, request = status.finger_status(axis), status.position(axis), base.position(axis)
    return what is ObjectStatus.IN_MOTION or not agrees(status.model, request, what, position, direction=0)
