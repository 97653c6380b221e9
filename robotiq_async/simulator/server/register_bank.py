"""The gripper's registers as a pymodbus device. Only this file knows pymodbus's simulator classes."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final

from pymodbus.simulator import DataType, SimData, SimDevice

from robotiq_async.values.registers import REGISTER_COUNT, RTU_REGISTERS

from ..functions import READ_HOLDING, READ_INPUT, READ_WRITE

if TYPE_CHECKING:
    from pymodbus.constants import ExcCodes

    from ..physics.gripper import SimulatedGripper
    from ..troubles.fault_injector import FaultInjector

_STARTS: Final = (0, RTU_REGISTERS.request, RTU_REGISTERS.status)


def is_served(address: int, count: int) -> bool:
    """Whether registers lie within one block."""
    return any(start <= address and address + count <= start + REGISTER_COUNT for start in _STARTS)


class RegisterBank:
    """Where the registers of a gripper are found, on either kind of link.

    ======  ======================  ======================  =================
    start   FC03, FC23 read         FC04 reads              FC06, FC16, FC23
    ======  ======================  ======================  =================
    0x0000  request block           status block            request block
    0x03E8  request block           request block           request block
    0x07D0  status block            status block            address refused
    ======  ======================  ======================  =================

    FC23 writes before it reads. Where function 3 has to do for 4, it reads the status at 0x0000.
    """

    def __init__(self, gripper: SimulatedGripper, troubles: FaultInjector) -> None:
        self._gripper = gripper
        self._troubles = troubles

    def device(self) -> SimDevice:
        """A device that answers any unit id."""
        blocks = [
            SimData(start, count=REGISTER_COUNT, datatype=DataType.REGISTERS, readonly=readonly)
            for start, readonly in zip(_STARTS, (False, False, True), strict=True)
        ]
        return SimDevice(id=0, simdata=blocks, action=self._access)

    # The signature that pymodbus 3.16 calls; it was another one in earlier releases.
    async def _access(
        self,
        function_code: int,
        start_address: int,
        address: int,
        count: int,
        current_registers: list[int],
        set_values: list[int] | list[bool] | None,
    ) -> ExcCodes | None:
        """Carry out an access; pymodbus has checked that it lies within one block that allows it."""
        block = max(start for start in _STARTS if start <= address)
        offset = address - block
        if set_values is not None:
            self._gripper.write(offset, [int(value) for value in set_values])
        elif function_code in (READ_HOLDING, READ_INPUT, READ_WRITE):
            is_status = block == RTU_REGISTERS.status or (block == 0 and self._reads_status(function_code))
            registers = self._gripper.status_registers() if is_status else self._gripper.request_registers
            first = address - start_address
            current_registers[first : first + count] = registers[offset : offset + count]
        return None

    def _reads_status(self, function_code: int) -> bool:
        """Whether a function reads the status at 0x0000, and not the request."""
        status = READ_HOLDING if self._troubles.reads_only_with_function_3 else READ_INPUT
        return function_code == status
