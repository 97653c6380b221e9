"""The next image: what the gripper has been asked so far, with everything on the desk put in."""

from __future__ import annotations

from dataclasses import replace

from ..enums import AXES, Finger, ObjectStatus
from ..wire.request import AxisRequest, Request
from ..wire.status import RobotiqStatus
from .adoption import agrees
from .pending import Desk


def compose(base: Request, desk: Desk, status: RobotiqStatus, gripping: Finger) -> Request:
    """The image with everything that callers ask for; axes that nobody addresses stay as they are.

    Args:
        base: the image that acts now.
        desk: what is asked for. A halt goes alone: the rest follows once the gripper has stopped.
        status: the newest status.
        gripping: the axes that were in contact when rGTO was last set.
    """
    # rACT is for the sequences: raised here it would activate a gripper that has lost its activation. And
    # rATR would let go.
    base = replace(base, activate=base.activate and status.activation_echo, release=False)
    if desk.halt is not None:
        return replace(base, go=False)
    if desk.positions and not base.go:
        # Raising rGTO wakes every axis. One that gripped keeps its request, or the grip would be gone.
        base = base.with_positions({axis: status.position(axis) for axis in AXES if axis not in gripping})
    held = {axis: status.position(axis) for axis in AXES if axis in desk.hold and drifts(axis, base, status)}
    positions = held | desk.positions
    return replace(
        base,
        go=base.go or bool(desk.positions),
        axes=tuple(
            AxisRequest(
                positions.get(axis, old.position),
                desk.speeds.get(axis, old.speed),
                desk.forces.get(axis, old.force),
            )
            for axis, old in zip(AXES, base.axes, strict=True)
        ),
    )


def drifts(axis: Finger, base: Request, status: RobotiqStatus) -> bool:
    """Whether an axis moves or is about to: then holding it means asking for where it is.

    An axis in contact keeps its request, and with it its grip; so does one that stands where it was asked
    to. What an axis does may still come from the request before this one: then the two disagree.
    """
    what, position = status.finger_status(axis), status.position(axis)
    return base.go and (
        what is ObjectStatus.IN_MOTION or not agrees(base.position(axis), what, position, direction=0)
    )
