"""The images that are written, and the gate through which they leave: it alone decides about rACT and rATR.

A rising rACT moves all fingers to their stops, and rATR releases the part [manual 2012, 4.6]. An image is
made from an older one, so it could carry rACT or rATR along by accident: a command after another client's
reset, a stop that crosses a power cycle, a hold after a release.

So an image has rACT only if the gripper shows rACT and none of our images may clear it first. An image never
has rATR. There are two exceptions: an activation may raise rACT, and a release may raise rATR.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace

from ..values.enums import NO_AXES, Finger
from ..values.request import AxisRequest, Request
from ..values.status import RobotiqStatus
from .pending import Pending


def merged(
    base: Request,
    pending: Pending,
    status: RobotiqStatus,
    *,
    gripping: Finger = NO_AXES,
    held: Mapping[Finger, int],
) -> Request:
    """Merge pending changes into ``base``. Other axes keep their requests, unless this sets rGTO."""
    # ``gripping`` has the axes that were in contact when rGTO was last set, ``held`` the place of each axis
    # that is to be stopped.
    if pending.positions and not base.go:
        # rGTO starts every axis [manual 2012, 4.6]: ask each for where it is. An axis that gripped keeps its
        # request, or it would lose its grip.
        base = base.with_positions(
            {axis: status.position(axis) for axis in status.model.axes if axis not in gripping}
        )
    # With rGTO set, an axis that is not addressed keeps its position request, and with it its motion or grip:
    # so speed and force alone start nothing.
    positions = {**held, **pending.positions}
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
    """Clear rGTO and request the present position of every axis, so that no axis starts."""
    # The positions count when any client sets rGTO next.
    here = {axis: status.position(axis) for axis in status.model.axes}
    return replace(base, go=False).with_positions(here)


def gate(
    image: Request,
    status: RobotiqStatus,
    *,
    may_reset: bool = False,
    activates: bool = False,
    releases: bool = False,
) -> Request:
    """The image as it may be written: ``activates`` or ``releases`` if it begins a requested procedure."""
    # ``may_reset`` if our earlier image may reset the gripper before this one acts.
    # The race that is left: after a stop has_activated() in stops.py finds it, after a command or a hold
    # sees_stray() in ledger.py.
    activate = image.activate and (activates or (status.activation_echo and not may_reset))
    release = image.release and releases
    if activate is image.activate and release is image.release:
        return image  # the usual case
    return replace(image, activate=activate, release=release)
