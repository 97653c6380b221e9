"""The eight status registers of a controller."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from robotiq_async.values import registers as reg
from robotiq_async.values.enums import ObjectStatus

if TYPE_CHECKING:
    from collections.abc import Sequence

    from robotiq_async.values.enums import Fault

    from .controller import Controller

_AS_REGISTERS: Final = struct.Struct(">8H")
_AXIS_BYTES: Final = tuple(
    (echo.byte, position.byte, current.byte)
    for echo, position, current in zip(reg.gPR, reg.gPO, reg.gCU, strict=True)
)
_MOVING, _SOME_STOPPED, _ALL_STOPPED, _ALL_ARRIVED = range(4)


def status_registers(controller: Controller, time: float, fault: Fault) -> reg.Registers:
    """What the gripper reports at a time, with a fault code.

    gDT and gSTA are 0 unless gIMC = 3. Without rGTO an axis in a contact or at its request keeps
    its gDT, unless the gripper has another habit; one that was stopped on its way reads 0. So gSTA = 0 then
    does not mean motion.
    """
    content = bytearray(2 * reg.REGISTER_COUNT)
    model, request, statuses = controller.model, controller.request, controller.shown_statuses(time)
    content[0] = request.activate << reg.gACT.shift | request.go << reg.gGTO.shift
    content[0] |= controller.progress << reg.gIMC.shift
    if model.has_modes:
        content[0] |= request.mode << reg.gMOD.shift | _summary(statuses[:3]) << reg.gSTA.shift
    content[reg.gFLT.byte] = fault
    for axis, status, shown, echo, (echo_byte, position_byte, current_byte) in zip(
        controller.axes, statuses, model.object_status, controller.echoes, _AXIS_BYTES, strict=False
    ):
        content[shown.byte] |= status << shown.shift
        content[echo_byte] = echo
        content[position_byte] = round(axis.position(time))
        content[current_byte] = axis.current(time)
    return _AS_REGISTERS.unpack(content)


def _summary(fingers: Sequence[ObjectStatus]) -> int:
    """Return gSTA of the three fingers."""
    if ObjectStatus.IN_MOTION in fingers:
        return _MOVING
    contacts = sum(status.is_contact for status in fingers)
    if contacts == len(fingers):
        return _ALL_STOPPED
    return _SOME_STOPPED if contacts else _ALL_ARRIVED
