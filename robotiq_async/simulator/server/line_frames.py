"""Frames on a serial line that several grippers share: each hears the requests to others, and their replies.

A frame of another unit does not say whether it is a request or a reply. So its length is tried as both, and
the one with its checksum counts: by chance a part of a frame has it once in 65,536 times.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from pymodbus.framer import FramerRTU

_CRC: Final = 2
_LONGEST_FRAME: Final = 256
_EXCEPTION: Final = 0x80


class _Length(NamedTuple):
    """The length of a frame: bytes beside its data, and the index of the byte that counts these."""

    fixed: int
    count_at: int | None = None

    def of(self, line: bytearray) -> int | None:
        """The bytes of the frame that the line begins with; None while they are not known."""
        if self.count_at is None:
            return self.fixed
        return None if len(line) <= self.count_at else self.fixed + line[self.count_at]


_OF_EIGHT: Final = _Length(8)
_WITH_DATA: Final = _Length(9, 6)
_READ_REPLY: Final = _Length(5, 2)
_LENGTHS: Final[dict[int, tuple[_Length, ...]]] = {
    **dict.fromkeys((1, 2, 3, 4), (_OF_EIGHT, _READ_REPLY)),
    **dict.fromkeys((5, 6), (_OF_EIGHT,)),
    **dict.fromkeys((15, 16), (_WITH_DATA, _OF_EIGHT)),
    22: (_Length(10),),
    23: (_Length(13, 10), _READ_REPLY),
}
"""Of the request and the reply of each function of Modbus that moves data."""


def has_checksum(frame: bytes) -> bool:
    return FramerRTU.check_CRC(frame[:-_CRC], int.from_bytes(frame[-_CRC:], "big"))


def size_of_others(line: bytearray) -> int | None:
    """The bytes of the frame of another unit that a line begins with.

    None while it is not whole, 0 without such a frame, or with a function that is not known.
    """
    if len(line) < 2:
        return None
    lengths = (_Length(5),) if line[1] & _EXCEPTION else _LENGTHS.get(line[1], ())
    sizes = [length.of(line) for length in lengths]
    known = sorted(size for size in sizes if size is not None)
    for size in known:
        if size <= len(line) and has_checksum(bytes(line[:size])):
            return size
    may_come = None in sizes or any(len(line) < size <= _LONGEST_FRAME for size in known)
    return None if may_come else 0
