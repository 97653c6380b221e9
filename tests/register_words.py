"""Status words built byte by byte after the manual, not with the library's own tables."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import pairwise

from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Mode
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus

REQUEST_RESERVED = (0xE0, 0xF3, 0xFF, *(0,) * 12, 0xFF)
"""The bits that must be written 0 in each of the sixteen request bytes (rGLV and rAAC among them)."""


def registers_of(content: Sequence[int]) -> tuple[int, ...]:
    """Eight registers of sixteen bytes: byte 2n is the high half of register n."""
    assert len(content) == 16
    return tuple(content[n] << 8 | content[n + 1] for n in range(0, 16, 2))


def request_of(content: Sequence[int]) -> Request:
    """The request in fourteen bytes; what none of its bits says is lost."""
    hand, individual, *axes = content
    return Request(
        activate=bool(hand & 0x01),
        mode=Mode(hand >> 1 & 0x03),
        go=bool(hand & 0x08),
        release=bool(hand & 0x10),
        individual_fingers=bool(individual & 0x04),
        individual_scissor=bool(individual & 0x08),
        axes=tuple(AxisRequest(*axes[n : n + 3]) for n in range(0, 12, 3)),
    )


def bytes_of(registers: Sequence[int]) -> list[int]:
    """The sixteen bytes of eight registers, in the order of the wire."""
    return [half for register in registers for half in (register >> 8, register & 0xFF)]


def four(values: int | Sequence[int]) -> Sequence[int]:
    """One value for A, B, C and the scissor, or four of them."""
    return (values,) * 4 if isinstance(values, int) else values


def status_of(
    byte_0: int,
    byte_1: int = 0x00,
    fault: int = 0x00,
    *,
    echo: int | Sequence[int] = 0,
    position: int | Sequence[int] = 0,
    current: int | Sequence[int] = 0,
    at: float = 0.0,
    sequence: int = 0,
) -> RobotiqStatus:
    """A status from its first three bytes and what the four axes report."""
    axes = zip(four(echo), four(position), four(current), strict=True)
    content = [byte_0, byte_1, fault, *(byte for axis in axes for byte in axis), 0]
    return RobotiqStatus.from_registers(registers_of(content), timestamp=at, sequence=sequence)


def with_object_status(status: Registers, old: Registers) -> Registers:
    """A status with gSTA and gDT of an older one."""
    return (status[0] & 0x3F00 | old[0] & 0xC0FF, *status[1:])


def only_holds(gripper: SimulatedGripper, since: int) -> bool:
    """Whether all writes after so many only request axes to stay where they have stayed."""
    writes = gripper.writes[max(since - 1, 0) :]
    images = [Request.from_registers(write.registers, gripper.model) for write in writes]
    for before, image in pairwise(images):
        for axis in gripper.model.axes:
            is_asked_anew = image.position(axis) != before.position(axis)
            if is_asked_anew and abs(image.position(axis) - gripper.position(axis)) > 2:
                return False
    return True
