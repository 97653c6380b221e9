"""The trigger that a status gives the state machine."""

from __future__ import annotations

from functools import cache

from ..values.enums import Fault, Initialization, Trigger
from ..values.model import Model
from ..values.status import RobotiqStatus


def classify(status: RobotiqStatus) -> Trigger:
    """The condition that a status shows, one of five.

    A serious fault comes first: gIMC = 0 with a fault is an automatic release and not a reset.
    """
    # Only gACT, gIMC and gFLT decide. They rarely change and this runs at every poll, so it is cached.
    registers = status.registers
    return _classify(registers[0] >> 8, registers[1] >> 8 & 0x0F, status.model)


def is_activating(status: RobotiqStatus) -> bool:
    """Whether an activation is under way. A change of mode is busy as well, and keeps what the hand holds."""
    return classify(status) is Trigger.SEEN_BUSY and status.initialization is Initialization.ACTIVATING


@cache
def _classify(activation: int, fault: int, model: Model) -> Trigger:
    """``activation`` is the byte with gACT and gIMC, ``fault`` is gFLT."""
    status = RobotiqStatus((activation << 8, fault << 8, 0, 0, 0, 0, 0, 0), model=model)
    if status.fault is Fault.AUTOMATIC_RELEASE_DONE:
        return Trigger.SEEN_RELEASED
    if status.fault.is_serious:
        return Trigger.SEEN_FAULT
    if not status.activation_echo and status.initialization is Initialization.RESET:
        return Trigger.SEEN_RESET
    if status.activation_echo and status.is_activated:
        return Trigger.SEEN_READY
    return Trigger.SEEN_BUSY
