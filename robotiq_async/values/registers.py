"""The gripper's two blocks of registers, as data.

Sixteen request bytes go to the gripper and sixteen status bytes come back. Register n holds byte 2n in
its high half and byte 2n+1 in its low half. One :class:`Field` serves the decoder, the encoder, the
simulator and the tables in the docs. The layout follows the instruction manual of the 3-Finger
gripper (editions 2012, 2014 and 2018 agree but for the glove and centring bits).
"""

from __future__ import annotations

from collections.abc import MutableSequence, Sequence
from dataclasses import dataclass, field
from typing import Final

from .checks import as_int, repr_of

REGISTER_COUNT: Final = 8  # registers in either block

Registers = tuple[int, ...]  # eight registers of 16 bits
Echo = tuple[int, ...]  # repeated by a status from a request: activation, go, the position of each axis


@dataclass(frozen=True, slots=True)
class Field:
    """A bit field of one byte of a block.

    Attributes:
        byte: index of the byte, 0..15.
        shift: lowest bit within the byte.
        width: number of bits.
        doc: its meaning.
    """

    byte: int
    shift: int = 0
    width: int = 8
    doc: str = ""
    # Its place in the registers, worked out once: fields are read and written at every poll.
    _word: int = field(init=False, repr=False, compare=False)
    _offset: int = field(init=False, repr=False, compare=False)
    _mask: int = field(init=False, repr=False, compare=False)

    def __post_init__(self) -> None:
        object.__setattr__(self, "_word", self.byte // 2)
        object.__setattr__(self, "_offset", self.shift + (0 if self.byte % 2 else 8))
        object.__setattr__(self, "_mask", (1 << self.width) - 1)

    def read(self, registers: Sequence[int]) -> int:
        """The field's value in a block of eight registers."""
        return registers[self._word] >> self._offset & self._mask

    def write(self, registers: MutableSequence[int], value: int) -> None:
        """Put a value into a block in place."""
        mask, offset = self._mask, self._offset
        if not 0 <= value <= mask:
            raise ValueError(
                f"value {value} does not fit into {self.width} bits of byte {self.byte}: 0..{mask}"
            )
        registers[self._word] = registers[self._word] & ~(mask << offset) | value << offset


# Request: client to gripper. Bits that are not named are reserved and stay 0.
rACT: Final = Field(0, 0, 1, "activate; 0 resets the gripper and its faults")
rMOD: Final = Field(0, 1, 2, "mode of simple control: basic, pinch, wide, scissor; ignored while rICS = 1")
rGTO: Final = Field(0, 3, 1, "go to the requested positions; 0 stops")
rATR: Final = Field(0, 4, 1, "automatic release")
rARD: Final = Field(0, 5, 1, "automatic release opens; 0 closes (2F and Hand-E alone)")
rICF: Final = Field(1, 2, 1, "fingers A, B, C take their own registers")
rICS: Final = Field(1, 3, 1, "the scissor takes its own registers; mode selection is off")
rPR: Final = tuple(Field(3 + 3 * n, doc=f"position request of {name}") for n, name in enumerate("ABCS"))
rSP: Final = tuple(Field(4 + 3 * n, doc=f"speed of {name}") for n, name in enumerate("ABCS"))
rFR: Final = tuple(Field(5 + 3 * n, doc=f"force of {name}") for n, name in enumerate("ABCS"))

# Status: gripper to client.
gACT: Final = Field(0, 0, 1, "echo of rACT; 1 while the activation still runs")
gMOD: Final = Field(0, 1, 2, "echo of rMOD")
gGTO: Final = Field(0, 3, 1, "echo of rGTO")
gIMC: Final = Field(0, 4, 2, "0 reset, release or not begun, 1 activating, 2 changing mode, 3 complete")
gSTA: Final = Field(0, 6, 2, "0 moving, 1 one or two fingers stopped early, 2 all early, 3 all reached")
gDT: Final = tuple(
    Field(1, 2 * n, 2, f"{name}: 0 moving, 1 contact opening, 2 contact closing, 3 at position")
    for n, name in enumerate("ABCS")
)
gOBJ: Final = Field(0, 6, 2, "as gDT, of a 2F or a Hand-E: instead of gSTA and gDT")
gFLT: Final = Field(2, 0, 4, "fault code; the high nibble is not part of it")
kFLT: Final = Field(
    2, 4, 4, "fault of the Universal Controller before a 2F or a Hand-E; 0 where there is none"
)
gPR: Final = tuple(Field(3 + 3 * n, doc=f"echo of the position of {name}") for n, name in enumerate("ABCS"))
gPO: Final = tuple(Field(4 + 3 * n, doc=f"position of {name}") for n, name in enumerate("ABCS"))
gCU: Final = tuple(Field(5 + 3 * n, doc=f"current of {name}, 10 mA a count") for n, name in enumerate("ABCS"))
_RESERVED: Final = (Field(2, 4, 4), Field(15))

MILLIAMPERE_PER_COUNT: Final = 10
"""gCU: the manual's worked example reads 0x0F as 150 mA (2014, p. 69); where it describes the register, the
relation is upside down (2014, p. 54; 2018, p. 41)."""


@dataclass(frozen=True, slots=True)
class RegisterMap:
    """Addresses and functions of the two blocks on one kind of link (manual 2014, pp. 59, 75).

    Attributes:
        request: address of the first request register.
        status: address of the first status register.
        read_function: Modbus function that reads the status block, 3 or 4.
        device_id: the unit id the gripper is shipped with.
        count: registers of either block that are read and written, 1..8; the others are 0.
        write_function: Modbus function that writes the request block: 16, or 23, which also reads the status.
        is_sure: whether function 23 is known to be served; if not, it is tried before it is used.
    """

    request: int
    status: int
    read_function: int
    device_id: int
    count: int = REGISTER_COUNT
    write_function: int = 16
    is_sure: bool = False


TCP_REGISTERS: Final = RegisterMap(request=0x0000, status=0x0000, read_function=4, device_id=2)
RTU_REGISTERS: Final = RegisterMap(request=0x03E8, status=0x07D0, read_function=3, device_id=9)


def status_reserved(has_modes: bool) -> tuple[Field, ...]:
    """The status bits without a meaning in the manual, which read 0. Byte 2 of a sibling has kFLT as well."""
    return _RESERVED if has_modes else _RESERVED[1:]


def check_registers(registers: Sequence[int]) -> Registers:
    """Eight registers of 16 bits as a tuple of plain ints."""
    block = tuple(registers)
    if len(block) != REGISTER_COUNT:
        raise ValueError(f"registers: expected {REGISTER_COUNT} of them, got {len(block)}")
    # A fast path for plain tuples: each status passes here.
    return tuple(
        register if type(register) is int and 0 <= register <= 0xFFFF else _checked(index, register)
        for index, register in enumerate(block)
    )


def _checked(index: int, given: object) -> int:
    register = as_int(given)
    if register is None:
        raise TypeError(f"registers[{index}] must be an int in 0..65535, got {repr_of(given)}")
    if not 0 <= register <= 0xFFFF:
        raise ValueError(f"registers[{index}] must be in 0..65535, got {register}")
    return register
