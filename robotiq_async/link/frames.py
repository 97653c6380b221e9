"""Request frames, and the check of every byte of a reply against the request that it should answer.

A client that accepts a reply with a wrong function code, too few registers or another transaction id would
report positions that are not true. No I/O here: bytes in, a verdict out.
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import lru_cache
from struct import Struct
from typing import Final, NamedTuple

from pymodbus.framer import FramerRTU

from ..values.errors import ProtocolError
from ..values.registers import REGISTER_COUNT, RegisterMap, Registers
from .outcome import Noise, Refused, Stray

_EXCEPTIONS = {
    1: "illegal function",
    2: "illegal data address",
    3: "illegal data value",
    4: "device failure",
    5: "acknowledge",
    6: "device busy",
    10: "gateway path unavailable",
    11: "gateway target does not respond",
}
_FROM_GATEWAYS: Final = (10, 11)
"""The exceptions that only a gateway sends (Modbus Application Protocol 7)."""

CHECKSUM: Final = 2
"""Bytes of the checksum at the end of a frame on a serial line."""
_READ_FUNCTIONS: Final = (3, 4)
"""Function codes of reads of registers."""
_WRITE_FUNCTION: Final = 16
"""Function code of a write of several registers."""
_WRITE_AND_READ_FUNCTION: Final = 23
"""Function code of a write and a read in one exchange; the device writes first."""
_READ_REQUEST: Final = Struct(">BBHH")
"""Unit, function, address, count."""
_WRITE_REQUEST: Final = Struct(">BBHHB")
"""Unit, function, address, count, number of bytes; the registers follow."""
_WRITE_PART: Final = Struct(">HHB")
"""Address, count, number of bytes."""
_HEADER: Final = Struct(">HHH")
"""Before a request over TCP: transaction, protocol 0, bytes that follow."""
_BLOCK: Final = Struct(f">{REGISTER_COUNT}H")


def read_request(registers: RegisterMap, count: int) -> bytes:
    """Unit and PDU of a read of the first ``count`` status registers, 1..8."""
    return _READ_REQUEST.pack(registers.device_id, registers.read_function, registers.status, count)


def write_request(registers: RegisterMap, image: Sequence[int]) -> bytes:
    """Unit and PDU of the write of an image of eight registers (FC16), as many of them as the gripper has."""
    count = registers.count
    head = _WRITE_REQUEST.pack(registers.device_id, _WRITE_FUNCTION, registers.request, count, 2 * count)
    return head + _BLOCK.pack(*image)[: 2 * count]


def write_and_read_request(registers: RegisterMap, image: Sequence[int]) -> bytes:
    """Unit and PDU of a write of an image and a read of the status in one exchange (FC23)."""
    count = registers.count
    head = _READ_REQUEST.pack(registers.device_id, _WRITE_AND_READ_FUNCTION, registers.status, count)
    head += _WRITE_PART.pack(registers.request, count, 2 * count)
    return head + _BLOCK.pack(*image)[: 2 * count]


def tcp_frame(number: int, request: bytes) -> bytes:
    """A request with the header of Modbus TCP."""
    return _HEADER.pack(number, 0, len(request)) + request


@lru_cache(maxsize=16)  # a poll is always the same
def serial_frame(request: bytes) -> bytes:
    """A request with the checksum of a serial line."""
    return request + FramerRTU.compute_CRC(request).to_bytes(CHECKSUM, "big")


def registers_in(body: bytes) -> Registers:
    """The registers in the body of a reply to a read; all others are 0."""
    if body[1] == _BLOCK.size:
        return _BLOCK.unpack_from(body, 2)  # the usual case
    return _BLOCK.unpack(body[2 : 2 + body[1]].ljust(_BLOCK.size, b"\0"))


def is_write(frame: bytes) -> bool:
    """Whether a request frame of a serial line writes."""
    return frame[1] in (_WRITE_FUNCTION, _WRITE_AND_READ_FUNCTION)


class Expected(NamedTuple):
    """The one reply that answers a request.

    Attributes:
        start: the first bytes of the good reply: header, function code and the bytes that must follow it.
        size: number of bytes of the good reply.
        refusal: the first bytes of an exception reply: header and function code.
        refusal_size: number of bytes of an exception reply.
        checksum: number of bytes of the checksum, at the end of both replies; 0 if there is none.
    """

    start: bytes
    size: int
    refusal: bytes
    refusal_size: int
    checksum: int

    def verdict(self, frame: bytes) -> bytes | Refused | Noise | None:
        """The body of a whole answer, from the function code on; None while more must come."""
        if len(frame) == self.size and frame.startswith(self.start):
            return self._damage(frame) or frame[len(self.refusal) - 1 : self.size - self.checksum]
        if _agree(frame, self.start):
            if len(frame) < self.size:
                return None
            return noise(f"{len(frame) - self.size} bytes more than the answer: {show(frame)}")
        if not _agree(frame, self.refusal):
            return noise(self._misfit(frame))
        if len(frame) < self.refusal_size:
            return None
        code = frame[len(self.refusal)]  # but a damaged reply refuses nothing
        return self._damage(frame) or Refused(ProtocolError(self._refused(code)), code)

    def _damage(self, frame: bytes) -> Noise | None:
        end = len(frame) - self.checksum
        if not self.checksum or FramerRTU.check_CRC(frame[:end], int.from_bytes(frame[end:], "big")):
            return None
        return noise(f"a wrong checksum: {show(frame)}")

    def after(self, header: bytes) -> Expected:
        """The same reply with a header before it."""
        start, refusal, more = header + self.start, header + self.refusal, len(header)
        return Expected(start, more + self.size, refusal, more + self.refusal_size, self.checksum)

    @property
    def _function(self) -> int:
        return self.refusal[-1] & 0x7F

    @property
    def _count(self) -> int:
        """The number of registers that the good answer to a write confirms."""
        return int.from_bytes(self.start[-2:], "big")

    def _refused(self, code: int) -> str:
        """The message for an exception reply, with advice where there is some."""
        function = self._function
        who = "gateway" if code in _FROM_GATEWAYS else "gripper"
        said = f"the {who} refuses function {function}: exception {code} ({_EXCEPTIONS.get(code, 'unknown')})"
        if function == _WRITE_FUNCTION and code in (1, 2, 3):
            return said + _whole(self._count)
        if function in _READ_FUNCTIONS and code == 1:
            return f"{said}: read_function={7 - function} asks with the other one"
        return said

    def _misfit(self, frame: bytes) -> str:
        """The message for bytes that are not the answer."""
        at = len(self.start) - 2
        count = int.from_bytes(frame[at : at + 2], "big")  # of registers, in the answer to a write
        is_shorter = len(frame) == self.size and frame.startswith(self.start[:at]) and count < self._count
        if self._function == _WRITE_FUNCTION and is_shorter:
            what = f"it reports {count} registers written, and not {self._count}{_whole(self._count)}"
            return f"not the answer: {what}"
        return f"not the answer: {show(frame)}, expected {show(self.start)}..."


def after_others(received: bytes, unit: int) -> bytes:
    """The bytes after whole replies of other units than this one; none while a reply is not whole."""
    while received and received[0] != unit and (size := _reply_size(received)):
        if len(received) < size:
            return b""
        if not FramerRTU.check_CRC(received[: size - 2], int.from_bytes(received[size - 2 : size], "big")):
            break
        received = received[size:]
    return received


def _reply_size(received: bytes) -> int:
    """The bytes of a reply on a serial line by its first three, at the least while they do not suffice."""
    if len(received) < 3:
        return 3
    function, count = received[1:3]
    if function & 0x7F not in (*_READ_FUNCTIONS, _WRITE_FUNCTION, _WRITE_AND_READ_FUNCTION):
        return 0
    if function & 0x80:
        return 3 + CHECKSUM
    return 6 + CHECKSUM if function == _WRITE_FUNCTION else 3 + count + CHECKSUM


@lru_cache(maxsize=32)  # a poll is always the same
def expected_reply(request: bytes, *, checksum: int = 0) -> Expected:
    """The reply to a request (unit and PDU) of function 3, 4, 16 or 23, with a checksum of this size."""
    unit, function, payload = request[:1], request[1], 0
    if function == _WRITE_FUNCTION:
        pdu = request[1:6]  # the echo of address and count
    else:
        payload = 2 * int.from_bytes(request[4:6], "big")
        pdu = bytes((function, payload))
    refusal = unit + bytes((function | 0x80,))
    return Expected(unit + pdu, 1 + len(pdu) + payload + checksum, refusal, 3 + checksum, checksum)


@lru_cache(maxsize=32)
def expected_over_tcp(request: bytes) -> Expected:
    """The same over Modbus TCP, from the length on, which stands after transaction and protocol."""
    start, size, refusal, refusal_size, _ = expected_reply(request)
    return Expected(_length(size) + start, size + 2, _length(refusal_size) + refusal, refusal_size + 2, 0)


@lru_cache(maxsize=32)
def expected_in_a_tunnel(pdu: bytes) -> Expected:
    """The reply to a PDU through a tunnel, which keeps the unit id to itself."""
    start, size, refusal, refusal_size, _ = expected_reply(b"\0" + pdu)
    return Expected(start[1:], size - 1, refusal[1:], refusal_size - 1, 0)


def _whole(count: int) -> str:
    return f": a hand writes all {count} at once, and a gateway must let that through"


def _length(size: int) -> bytes:
    """The length field, which counts the bytes from the unit on."""
    return size.to_bytes(2, "big")


def show(frame: bytes) -> str:
    """Bytes for a message, shortened: a confused peer often sends long frames."""
    return frame.hex(" ") if len(frame) <= 32 else f"{frame[:32].hex(' ')}... ({len(frame)} bytes)"


def noise(message: str) -> Noise:
    """The outcome of bytes that cannot become the answer."""
    return Noise(ProtocolError(message))


def stray(data: bytes) -> Stray:
    """The outcome of bytes that answer nothing."""
    return Stray(ProtocolError(f"{len(data)} bytes without a request: {show(data)}"))


def _agree(frame: bytes, start: bytes) -> bool:
    """Whether the bytes so far match the expected start."""
    size = min(len(frame), len(start))
    return frame[:size] == start[:size]
