"""The next image: the request in force with the pending command merged into it."""

from __future__ import annotations

from dataclasses import replace

from ...values.enums import NO_AXES, Finger
from ...values.request import AxisRequest, Request
from ...values.status import RobotiqStatus
from ..contact import drifts
from .pending import PendingCommand


def merged(
    base: Request,
    pending: PendingCommand,
    status: RobotiqStatus,
    *,
    gripping: Finger,
    arrived: Finger,
    doubtful: Finger = NO_AXES,
) -> Request:
    """Merge a pending command into ``base``. Axes that it does not address keep their requests.

    Args:
        base: the image in force.
        pending: what callers ask for. A halt goes alone: the rest follows once the gripper has stopped.
        status: the newest status.
        gripping: the axes that were in contact when rGTO was last set.
        arrived: the axes that have come to rest under their requests.
        doubtful: the axes that show rest and may move all the same.
    """
    if pending.halting is not None:
        return replace(base, go=False)
    if pending.positions and not base.go:
        # rGTO starts every axis: ask each for where it is. An axis that gripped keeps its request, or it
        # would lose its grip.
        base = base.with_positions(
            {axis: status.position(axis) for axis in status.model.axes if axis not in gripping}
        )
    held = {
        axis: status.position(axis)
        for axis in status.model.axes
        if axis in pending.hold and drifts(axis, base, status, arrived, doubtful)
    }
    positions = held | pending.positions
    return replace(
        base,
        go=base.go or bool(pending.positions),
        axes=tuple(
            AxisRequest(
                positions.get(axis, old.position),
                pending.speeds.get(axis, old.speed),
                pending.forces.get(axis, old.force),
            )
            for axis, old in base.by_axis
        ),
    )


def at_rest(base: Request, status: RobotiqStatus) -> Request:
    """Clear rGTO and ask every axis to be where it is, so that no axis starts."""
    here = {axis: status.position(axis) for axis in status.model.axes}
    return replace(base, go=False).with_positions(here)


def stopped(base: Request, status: RobotiqStatus, *, settled: bool) -> Request | None:
    """The image that leaves the gripper stopped; None when rGTO is clear, and no write may set it.

    ``settled``: whether the last image acts.
    """
    if settled and not status.go_echo:
        return None
    # The shutdown must not reset a gripper that another client has activated.
    return replace(base, activate=base.activate or settled, go=False)
