"""The gripper's registers as a Modbus device has them: requests in, replies out, without their frames."""

from __future__ import annotations

import struct
from typing import TYPE_CHECKING, Final

from robotiq_async.values.registers import RTU_REGISTERS, Registers

from ..functions import READ_HOLDING, READ_INPUT, READ_WRITE, WRITE_MULTIPLE, WRITE_SINGLE

if TYPE_CHECKING:
    from collections.abc import Collection

    from ..physics.gripper import SimulatedGripper
    from ..troubles.troubled_link import TroubledLink

_REQUEST_START, _STATUS_START = RTU_REGISTERS.request, RTU_REGISTERS.status
_WRITABLE: Final = (0, _REQUEST_START)
_READABLE: Final = (0, _REQUEST_START, _STATUS_START)
_ILLEGAL_FUNCTION, _ILLEGAL_ADDRESS, _ILLEGAL_VALUE = 1, 2, 3
"""Exception codes (Modbus Application Protocol, chapter 7)."""
_MOST_READ: Final = 125
_MOST_WRITTEN: Final = 123
_MOST_WRITTEN_AND_READ: Final = 121
"""Registers in one request (Modbus Application Protocol, 6.3, 6.12 and 6.17)."""


class _RequestRefusedError(Exception):
    """A request that gets an exception instead of a reply."""

    def __init__(self, code: int) -> None:
        super().__init__(code)
        self.code = code


class RegisterBank:
    """The addresses of a gripper's registers, on either kind of link.

    ======  ======================  ======================  =================
    start   FC03, FC23 read         FC04 reads              FC06, FC16, FC23
    ======  ======================  ======================  =================
    0x0000  request block           status block            request block
    0x03E8  request block           request block           request block
    0x07D0  status block            status block            address refused
    ======  ======================  ======================  =================

    FC23 writes before it reads. Where function 3 has to do for 4, it reads the status at 0x0000.
    """

    def __init__(self, gripper: SimulatedGripper, troubles: TroubledLink) -> None:
        self._gripper = gripper
        self._troubles = troubles

    def answer(self, pdu: bytes, functions: Collection[int]) -> bytes:
        """Carry out a request, all of it or nothing; return the reply, or the exception that refuses it."""
        try:
            if pdu[0] not in functions or pdu[0] in self._troubles.refused_functions:
                raise _RequestRefusedError(_ILLEGAL_FUNCTION)
            return pdu[:1] + self._carry_out(pdu[0], pdu[1:])
        except _RequestRefusedError as refused:
            return bytes((pdu[0] | 0x80, refused.code))

    def _carry_out(self, function: int, data: bytes) -> bytes:
        if function == WRITE_SINGLE:
            _check(len(data) == 4)
            self._write(data[:2], data[2:])
            return data
        if function == WRITE_MULTIPLE:
            self._write(data[:2], _content(data[2:], _MOST_WRITTEN))
            return data[:4]
        _check(len(data) >= 4)
        address, count = struct.unpack_from(">HH", data)
        _check(1 <= count <= _MOST_READ)
        block = self._block_of(address, count, _READABLE)
        if function == READ_WRITE:
            self._write(data[4:6], _content(data[6:], _MOST_WRITTEN_AND_READ))
            if self._gripper.habits.answers_with_echo:
                self._gripper.carry_out_writes()
        else:
            _check(len(data) == 4)
        first = address - block
        registers = self._registers(function, block)[first : first + count]
        return struct.pack(f">B{count}H", 2 * count, *registers)

    def _write(self, at: bytes, content: bytes) -> None:
        address, count = int.from_bytes(at, "big"), len(content) // 2
        block = self._block_of(address, count, _WRITABLE)
        self._gripper.write(address - block, struct.unpack(f">{count}H", content))

    def _block_of(self, address: int, count: int, blocks: tuple[int, ...]) -> int:
        """The start of the block that has all of the registers."""
        for block in blocks:
            if block <= address and address + count <= block + self._troubles.served_registers:
                return block
        raise _RequestRefusedError(_ILLEGAL_ADDRESS)

    def _registers(self, function: int, block: int) -> Registers:
        function_of_the_status = READ_HOLDING if self._troubles.reads_only_with_function_3 else READ_INPUT
        if block == _STATUS_START or (block == 0 and function == function_of_the_status):
            return self._gripper.status_registers()
        return self._gripper.request_registers


def _check(is_right: bool) -> None:
    if not is_right:
        raise _RequestRefusedError(_ILLEGAL_VALUE)


def _content(data: bytes, most: int) -> bytes:
    """The registers to write, after their count in registers and in bytes."""
    _check(len(data) > 3)
    count, content = int.from_bytes(data[:2], "big"), data[3:]
    _check(1 <= count <= most and data[2] == 2 * count == len(content))
    return content
