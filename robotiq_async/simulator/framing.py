"""Cutting requests out of a stream of bytes, and refusing those that cannot be served."""

from __future__ import annotations

from typing import Final, NamedTuple

from pymodbus.constants import ExcCodes

from .bank import FUNCTIONS, WRITE_MULTIPLE, WRITE_SINGLE

_MBAP: Final = 7
_LONGEST_TCP_FRAME: Final = 260
_CRC: Final = 2
_MOST_READ: Final = 125


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
    raw = _take(inbox, size)
    return Frame(raw, raw[6], int.from_bytes(raw[:2], "big"), raw[_MBAP:])


def take_rtu(inbox: bytearray) -> Frame | None:
    """The first complete frame, taken out of the inbox; None while it is incomplete.

    After a function code that is not served there is no telling where the frame ends: the inbox is emptied.
    """
    if len(inbox) < 2:
        return None
    if inbox[1] not in FUNCTIONS:
        inbox.clear()
        return None
    size = 1 + 5 + _CRC
    if inbox[1] == WRITE_MULTIPLE:
        if len(inbox) < size - 1:
            return None
        size += 1 + inbox[6]
    if len(inbox) < size:
        return None
    raw = _take(inbox, size)
    return Frame(raw, raw[0], 0, raw[1:-_CRC])


def refusal(pdu: bytes) -> ExcCodes | None:
    """The exception for a request that pymodbus would answer wrongly or in earnest; None for any other."""
    if pdu[0] not in FUNCTIONS:
        return ExcCodes.ILLEGAL_FUNCTION
    count = int.from_bytes(pdu[3:5], "big")
    if pdu[0] == WRITE_MULTIPLE:
        fits = len(pdu) > 5  # pymodbus checks the rest
    else:
        fits = len(pdu) == 5 and (pdu[0] == WRITE_SINGLE or 1 <= count <= _MOST_READ)
    return None if fits else ExcCodes.ILLEGAL_VALUE


def _take(inbox: bytearray, size: int) -> bytes:
    raw = bytes(inbox[:size])
    del inbox[:size]
    return raw
