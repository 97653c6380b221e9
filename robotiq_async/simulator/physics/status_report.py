"""The eight status registers of a controller."""

from __future__ import annotations

from typing import TYPE_CHECKING

from robotiq_async.values import registers as reg
from robotiq_async.values.enums import ObjectStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotiq_async.values.enums import Fault

    from .controller import Controller

_MOVING, _SOME_STOPPED, _ALL_STOPPED, _ALL_ARRIVED = range(4)


def status_registers(controller: Controller, time: float, fault: Fault) -> reg.Registers:
    """What the gripper reports at a time, with a fault code.

    gDT and gSTA are 0 unless gIMC = 3. Without rGTO an axis in a contact or at its request keeps
    its gDT, unless the gripper has another habit; one that was stopped on its way reads 0. So gSTA = 0 then
    does not mean motion.
    """
    block = [0] * reg.REGISTER_COUNT
    model, request, statuses = controller.model, controller.request, controller.shown_statuses(time)
    reg.gACT.write(block, request.activate)
    reg.gGTO.write(block, request.go)
    reg.gIMC.write(block, controller.progress)
    reg.gFLT.write(block, fault)
    for index, (axis, echo) in enumerate(zip(controller.axes, controller.echoes, strict=True)):
        reg.gPR[index].write(block, echo)
        reg.gPO[index].write(block, round(axis.position(time)))
        reg.gCU[index].write(block, axis.current(time))
        model.object_status[index].write(block, statuses[index])
    if model.has_modes:
        reg.gMOD.write(block, request.mode)
        reg.gSTA.write(block, _summary(statuses[:3]))
    return tuple(block)


def _summary(fingers: Sequence[ObjectStatus]) -> int:
    """Return gSTA of the three fingers."""
    if ObjectStatus.IN_MOTION in fingers:
        return _MOVING
    contacts = sum(status.is_contact for status in fingers)
    if contacts == len(fingers):
        return _ALL_STOPPED
    return _SOME_STOPPED if contacts else _ALL_ARRIVED
