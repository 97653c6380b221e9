"""Requests and replies as bytes: cuts them out of a stream, and frames them."""

from __future__ import annotations

import struct
from typing import Final, NamedTuple

from pymodbus.framer import FramerRTU

from ..functions import READ_WRITE, RTU_FUNCTIONS, WRITE_MULTIPLE
from .line_frames import has_checksum, size_of_others

_MBAP: Final = 7
_LONGEST_TCP_FRAME: Final = 260
_LONGEST_RTU_FRAME: Final = 256
_CRC: Final = 2
BROADCAST: Final = 0
"""The unit id of a request to all."""
_COUNT_AT: Final = {WRITE_MULTIPLE: 6, READ_WRITE: 10}
"""Index of the count of data bytes in an RTU frame."""


class BadFrameError(Exception):
    """The bytes are no Modbus; there is no telling where the next request begins."""


class Frame(NamedTuple):
    """One request.

    Attributes:
        unit: the unit id addressed.
        transaction: the transaction id, 0 on a serial line.
        pdu: function code and data.
    """

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
    return Frame(raw[6], int.from_bytes(raw[:2], "big"), raw[_MBAP:])


def take_rtu(inbox: bytearray, unit: int) -> Frame | None:
    """The first complete request to a unit or to all, taken out of the inbox; None while it is incomplete.

    Frames of other units, requests and replies, are left out. An own reply is never heard.

    After a function code that is not served, or a wrong checksum, there is no telling where the frame ends:
    the inbox is emptied.
    """
    while len(inbox) >= 2 and inbox[0] not in (BROADCAST, unit):
        others = size_of_others(inbox)
        if others is None:
            return None
        del inbox[: others or len(inbox)]
    size = _rtu_size(inbox)
    if size is None or len(inbox) < size:
        return None
    raw = bytes(inbox[:size])
    if not size or not has_checksum(raw):
        inbox.clear()
        return None
    del inbox[:size]
    return Frame(raw[0], 0, raw[1:-_CRC])


def _rtu_size(inbox: bytearray) -> int | None:
    """The length of the first frame in bytes; None while it is not known, 0 if the bytes begin no frame."""
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


def begins_with_frame(data: bytes, unit: int) -> bool:
    """Whether bytes begin with a whole frame: a request to a unit or to all, or any of another unit."""
    line = bytearray(data)
    if len(line) >= 2 and line[0] not in (BROADCAST, unit):
        return bool(size_of_others(line))
    return take_rtu(line, unit) is not None


def tcp_reply(frame: Frame, pdu: bytes) -> bytes:
    return struct.pack(">HHHB", frame.transaction, 0, len(pdu) + 1, frame.unit) + pdu


def rtu_reply(frame: Frame, pdu: bytes) -> bytes:
    content = bytes((frame.unit,)) + pdu
    return content + FramerRTU.compute_CRC(content).to_bytes(_CRC, "big")
