"""Cutting requests out of a stream of bytes, and refusing those that cannot be served."""

from __future__ import annotations

from typing import TYPE_CHECKING, Final, NamedTuple

from pymodbus.constants import ExcCodes
from pymodbus.framer import FramerRTU

from ..functions import READ_WRITE, RTU_FUNCTIONS, WRITE_MULTIPLE, WRITE_SINGLE
from .register_bank import is_served

if TYPE_CHECKING:
    from collections.abc import Collection

_MBAP: Final = 7
_LONGEST_TCP_FRAME: Final = 260
_LONGEST_RTU_FRAME: Final = 256
_CRC: Final = 2
_MOST_READ: Final = 125
_MOST_WRITTEN_AND_READ: Final = 121
_COUNT_AT: Final = {WRITE_MULTIPLE: 6, READ_WRITE: 10}
"""Where an RTU frame says how many bytes of data follow."""


class BadFrameError(Exception):
    """The bytes are no Modbus; there is no telling where the next request begins."""


class Frame(NamedTuple):
    """One request as it came.

    Attributes:
        raw: the whole frame.
        unit: the unit id asked for.
        transaction: the transaction id, 0 on a serial line.
        pdu: function code and data.
    """

    raw: bytes
    unit: int
    transaction: int
    pdu: bytes


def take_tcp(inbox: bytearray) -> Frame | None:
    """The first complete frame, taken out of the inbox; None while it is incomplete.

    Raises:
        BadFrameError: the header has another protocol id or an impossible length.
    """
    if len(inbox) < _MBAP:
        return None
    size = 6 + int.from_bytes(inbox[4:6], "big")
    if inbox[2:4] != b"\x00\x00" or not _MBAP < size <= _LONGEST_TCP_FRAME:
        raise BadFrameError(inbox[:_MBAP].hex(" "))
    if len(inbox) < size:
        return None
    raw = bytes(inbox[:size])
    del inbox[:size]
    return Frame(raw, raw[6], int.from_bytes(raw[:2], "big"), raw[_MBAP:])


def take_rtu(inbox: bytearray) -> Frame | None:
    """The first complete frame, taken out of the inbox; None while it is incomplete.

    After a function code that is not served, or a wrong checksum, there is no telling where the frame ends:
    the inbox is emptied.
    """
    size = _rtu_size(inbox)
    if size is None or len(inbox) < size:
        return None
    raw = bytes(inbox[:size])
    if not size or not FramerRTU.check_CRC(raw[:-_CRC], int.from_bytes(raw[-_CRC:], "big")):
        inbox.clear()
        return None
    del inbox[:size]
    return Frame(raw, raw[0], 0, raw[1:-_CRC])


def _rtu_size(inbox: bytearray) -> int | None:
    """The bytes of the first frame; None while its length is not known, 0 if it has none."""
    if len(inbox) < 2:
        return None
    if inbox[1] not in RTU_FUNCTIONS:
        return 0
    at = _COUNT_AT.get(inbox[1])
    if at is None:
        return 1 + 5 + _CRC
    if len(inbox) <= at:
        return None
    size = at + 1 + inbox[at] + _CRC
    return size if size <= _LONGEST_RTU_FRAME else 0


def refusal(pdu: bytes, functions: Collection[int]) -> ExcCodes | None:
    """The exception for a request that pymodbus would answer wrongly or in earnest; None for any other.

    Args:
        pdu: the request.
        functions: the Modbus functions of this kind of link.
    """
    if pdu[0] not in functions:
        return ExcCodes.ILLEGAL_FUNCTION
    count = int.from_bytes(pdu[3:5], "big")
    if pdu[0] == READ_WRITE:
        return _refusal_to_read_and_write(pdu, count)
    if pdu[0] == WRITE_MULTIPLE:
        fits = len(pdu) > 5  # pymodbus checks the rest
    else:
        fits = len(pdu) == 5 and (pdu[0] == WRITE_SINGLE or 1 <= count <= _MOST_READ)
    return None if fits else ExcCodes.ILLEGAL_VALUE


def _refusal_to_read_and_write(pdu: bytes, count: int) -> ExcCodes | None:
    """Refuse a request whose read part is out of range before its write part is carried out."""
    written = int.from_bytes(pdu[7:9], "big")
    if not (1 <= count <= _MOST_READ and 1 <= written <= _MOST_WRITTEN_AND_READ):
        return ExcCodes.ILLEGAL_VALUE
    if len(pdu) != 10 + 2 * written or pdu[9] != 2 * written:
        return ExcCodes.ILLEGAL_VALUE
    is_readable = is_served(int.from_bytes(pdu[1:3], "big"), count)
    return None if is_readable else ExcCodes.ILLEGAL_ADDRESS
