"""The messages of the link as pymodbus PDUs, made so that a poll costs little.

pymodbus builds a new request for each call, decodes register by register, and formats every reply for a
debug line that is switched off. So the request that asks for the status is encoded once, and the replies
to it are decoded by classes of ours, which :func:`register` tells a client to use.
"""

from __future__ import annotations

from collections.abc import Sequence
from struct import Struct, pack, unpack_from

from pymodbus.client import AsyncModbusSerialClient, AsyncModbusTcpClient
from pymodbus.pdu import ModbusPDU

from ..values.registers import REGISTER_COUNT, RegisterMap

_BLOCK = Struct(f">{REGISTER_COUNT}H")


class ReadRequest(ModbusPDU):
    """Asks for status registers; encoded once, sent any number of times."""

    rtu_frame_size = 8

    def __init__(self, registers: RegisterMap, count: int = REGISTER_COUNT) -> None:
        """Ask for the first ``count`` registers, 1..8."""
        super().__init__(dev_id=registers.device_id, address=registers.status, count=count)
        self.function_code = registers.read_function
        self._encoded = pack(">HH", registers.status, count)

    def encode(self) -> bytes:
        """The bytes after the function code."""
        return self._encoded


class WriteRequest(ModbusPDU):
    """Writes the whole image of eight registers (FC16)."""

    function_code = 16
    rtu_byte_count_pos = 6

    def __init__(self, registers: RegisterMap, image: Sequence[int]) -> None:
        """Write this image."""
        super().__init__(dev_id=registers.device_id, address=registers.request, registers=image)

    def encode(self) -> bytes:
        """The bytes after the function code."""
        return pack(">HHB", self.address, REGISTER_COUNT, 2 * REGISTER_COUNT) + _BLOCK.pack(*self.registers)


class InputRegistersReply(ModbusPDU):
    """The answer to a :class:`ReadRequest` over TCP (FC04)."""

    function_code = 4
    rtu_byte_count_pos = 2

    def decode(self, data: bytes) -> None:
        """Take the registers out of the bytes after the function code, which frames.py has checked."""
        self.registers = (
            _BLOCK.unpack_from(data, 1)
            if data[0] == _BLOCK.size
            else unpack_from(f">{data[0] // 2}H", data, 1)
        )

    def __str__(self) -> str:
        """Short: pymodbus asks for it at every reply, and then does not print it."""
        return type(self).__name__


class HoldingRegistersReply(InputRegistersReply):
    """The same over a serial line (FC03)."""

    function_code = 3


def register(client: AsyncModbusTcpClient | AsyncModbusSerialClient) -> None:
    """Let a client decode with the classes above."""
    client.register(InputRegistersReply)
    client.register(HoldingRegistersReply)
