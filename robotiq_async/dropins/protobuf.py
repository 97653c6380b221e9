"""Flat messages of Protocol Buffers, by the numbers of their fields: no generator and no package is needed.

The wire format is defined at https://protobuf.dev/programming-guides/encoding: a key for each field, with its
number and its kind, and then a varint, four bytes of a float, or a length and bytes.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Mapping

FieldValue = float | bytes
"""A float, an int or a bool; bytes of a text or of a message inside."""
VARINT, EIGHT_BYTES, BYTES, FOUR_BYTES = 0, 1, 2, 5


def encoded(fields: Mapping[int, FieldValue]) -> bytes:
    """A message of fields by their numbers; an int is written as an int, a float with single precision."""
    out = bytearray()
    for number, value in fields.items():
        if isinstance(value, bytes):
            out += _varint(number << 3 | BYTES) + _varint(len(value)) + value
        elif isinstance(value, int):
            out += _varint(number << 3 | VARINT) + _varint(value)
        else:
            out += _varint(number << 3 | FOUR_BYTES) + struct.pack("<f", value)
    return bytes(out)


def decoded(message: bytes) -> dict[int, FieldValue]:
    """The fields of a message by their numbers; the last of several counts, and doubles are passed over.

    Raises:
        ValueError: it is cut off, or has another kind of field.
    """
    try:
        return dict(_fields(message))
    except (IndexError, struct.error):
        raise ValueError(f"a message of {len(message)} bytes is cut off") from None


def _fields(message: bytes) -> Iterator[tuple[int, FieldValue]]:
    at = 0
    while at < len(message):
        key, at = _read_varint(message, at)
        number, kind = key >> 3, key & 7
        if kind == VARINT:
            value, at = _read_varint(message, at)
            yield number, value
        elif kind == FOUR_BYTES:
            yield number, struct.unpack_from("<f", message, at)[0]
            at += 4
        elif kind == EIGHT_BYTES:
            at += 8
        elif kind == BYTES:
            size, at = _read_varint(message, at)
            if at + size > len(message):
                raise IndexError
            yield number, message[at : at + size]
            at += size
        else:
            raise ValueError(f"a field of kind {kind} is none of proto3")


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    return bytes((*out, value))


def _read_varint(message: bytes, at: int) -> tuple[int, int]:
    value = shift = 0
    while True:
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
