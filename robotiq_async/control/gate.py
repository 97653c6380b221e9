"""The gate through which every image leaves: the one place that decides about rACT and rATR.

A rising rACT moves all fingers to their stops, and rATR releases the part [manual 2012, 4.6]. An image is
made from an older one, so either could be carried along by accident: by a command after another client's
reset, by a stop that crosses a power cycle, by a hold after a release. So an image has rACT only if the
gripper shows it, and rATR never; an activation may raise rACT, and a release rATR.
"""

from __future__ import annotations

from dataclasses import replace

from ..values.request import Request
from ..values.status import RobotiqStatus


def gate(
    image: Request, status: RobotiqStatus, *, activates: bool = False, releases: bool = False
) -> Request:
    """The image as it may be written: ``activates`` or ``releases`` if it begins what was asked for."""
    # The status may be a device cycle old. If another client resets the gripper within it, rACT passes and
    # activates [follows]. That is taken back: after a stop has_activated() in stops.py finds it, after a
    # command or a hold Begun in procedures.py.
    activate = image.activate and (activates or status.activation_echo)
    release = image.release and releases
    if activate is image.activate and release is image.release:
        return image  # the usual case
    return replace(image, activate=activate, release=release)
