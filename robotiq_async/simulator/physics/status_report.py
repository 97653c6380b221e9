"""The eight status registers of a controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotiq_async.enums import AXES, Initialization, ObjectStatus
from robotiq_async.wire import registers as reg

if TYPE_CHECKING:
    from collections.abc import Sequence

    from .controller import Controller

_MOVING, _SOME_STOPPED, _ALL_STOPPED, _ALL_ARRIVED = range(4)


def status_registers(controller: Controller, time: float) -> reg.Registers:
    """What the gripper reports at a time.

    gDT and gSTA are 0 unless gIMC = 3. Without rGTO an axis that stands in a contact or at its request keeps
    its gDT, one that was stopped on its way reads 0; so gSTA = 0 then does not mean motion.
    """
    block = [0] * reg.REGISTER_COUNT
    request = controller.request
    reg.gACT.write(block, request.activate)
    reg.gMOD.write(block, request.mode)
    reg.gGTO.write(block, request.go)
    reg.gIMC.write(block, controller.progress)
    reg.gFLT.write(block, controller.fault)
    for index, (axis, own) in enumerate(zip(controller.axes, request.axes, strict=True)):
        # The echo is the axis's own register even where simple control drives the axis by another.
        reg.gPR[index].write(block, own.position)
        reg.gPO[index].write(block, round(axis.position(time)))
        reg.gCU[index].write(block, axis.current(time))
    if controller.progress is Initialization.COMPLETE:
        statuses = [axis.status for axis in controller.axes]
        reg.gSTA.write(block, _summary(statuses[:3]))
        for index in range(len(AXES)):
            reg.gDT[index].write(block, statuses[index])
    return tuple(block)


def _summary(fingers: Sequence[ObjectStatus]) -> int:
    """Return gSTA of the three fingers."""
    if ObjectStatus.IN_MOTION in fingers:
        return _MOVING
    contacts = sum(status.is_contact for status in fingers)
    if contacts == len(fingers):
        return _ALL_STOPPED
    return _SOME_STOPPED if contacts else _ALL_ARRIVED
