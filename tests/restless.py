"""A simulated gripper that never says that it has come to rest."""

from __future__ import annotations

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values import registers as reg
from robotiq_async.values.enums import ObjectStatus
from robotiq_async.values.registers import Registers


class Restless(SimulatedGripper):
    """Its scissor is always in motion, if it is to be believed."""

    def status_registers(self) -> Registers:
        block = list(super().status_registers())
        reg.gDT[3].write(block, ObjectStatus.IN_MOTION)
        return tuple(block)
