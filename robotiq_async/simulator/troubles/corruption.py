"""Corruptions of the bytes of one reply, on any kind of link. No I/O: a reply in, bytes out.

Except for the error in its name, a function makes an orderly frame: length and checksum are computed again,
so that a client that notices has looked at the right thing.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import Final

from pymodbus.framer import FramerRTU

from ..functions import READ_HOLDING, READ_INPUT, READ_WRITE, WRITE_MULTIPLE, WRITE_SINGLE

Parts = Sequence[tuple[float, bytes]]
"""Parts to send, in order: (delay in seconds, bytes)."""

_ANOTHER = {
    READ_HOLDING: READ_INPUT,
    READ_INPUT: READ_HOLDING,
    READ_WRITE: READ_HOLDING,
    WRITE_SINGLE: WRITE_MULTIPLE,
    WRITE_MULTIPLE: WRITE_SINGLE,
}


@dataclass(frozen=True, slots=True)
class Reply:
    """The frame of one reply.

    Attributes:
        frame: all of it.
        serial: whether it goes over a serial line.
    """

    frame: bytes
    serial: bool

    @property
    def unit(self) -> int:
        return self.frame[0 if self.serial else 6]

    @property
    def pdu(self) -> bytes:
        return self.frame[1:-2] if self.serial else self.frame[7:]

    @property
    def is_to_a_write(self) -> bool:
        """Whether it answers a write; FC23 counts as a write, though its reply carries the status."""
        return self.pdu[0] & 0x7F in (WRITE_SINGLE, WRITE_MULTIPLE, READ_WRITE)

    @property
    def has_registers(self) -> bool:
        """Whether it carries registers, as the replies to reads and to FC23 do."""
        return self.pdu[0] & 0x7F not in (WRITE_SINGLE, WRITE_MULTIPLE)

    @property
    def is_exception(self) -> bool:
        """Whether the simulator refuses the request."""
        return bool(self.pdu[0] & 0x80)

    def changed(self, *, unit: int | None = None, pdu: bytes | None = None) -> Parts:
        """The reply with another unit or PDU, in an orderly frame."""
        body = bytes((self.unit if unit is None else unit,)) + (self.pdu if pdu is None else pdu)
        if self.serial:
            return ((0.0, body + FramerRTU.compute_CRC(body).to_bytes(2, "big")),)
        return ((0.0, self.frame[:4] + len(body).to_bytes(2, "big") + body),)


class TextReply(Reply):
    """A reply of the URCap's text port, which has no PDU."""

    @property
    def is_to_a_write(self) -> bool:
        """Whether it acknowledges a SET."""
        return self.frame == b"ack"

    @property
    def is_exception(self) -> bool:
        """The text port has no exceptions."""
        return False


def reply_on(link: str, frame: bytes) -> Reply:
    """The frame of a reply on a kind of link."""
    return TextReply(frame, serial=False) if link == "urcap" else Reply(frame, serial=link != "tcp")


Corruption = Callable[[Reply, float], Parts]
"""Makes the bytes to send out of a reply and the value of the trouble (see trouble.py)."""

ReplyPolicy = Callable[[bytes], Iterable[tuple[float, bytes]] | None]
"""Takes the frame of one reply; gives the parts to send, as (delay in seconds, bytes), or None to hang up.

An empty answer loses the reply. The request behind the reply has been carried out already.
"""


def unchanged(frame: bytes) -> Parts:
    """The default policy of a simulator: the reply at once and unchanged."""
    return ((0.0, frame),)


def delay(reply: Reply, value: float) -> Parts:
    """The reply comes later."""
    return ((value, reply.frame),)


_UNEVEN: Final = ((0.0, 0.010), (0.1, 0.020), (0.5, 0.035), (0.9, 0.060), (0.99, 0.120))
"""Shares of exchanges with a 2F-85 through a serial server, and the seconds that they take at most. Recorded
were means of 20 to 60 ms, with 10 to 30 beside them and a tail to 260 (pyRobotiqGripper); the shape between
is drawn by hand."""


def uneven(share: float, longest: float) -> float:
    """The seconds of a delay of which so many are shorter, 0..1; the longest is given."""
    quantiles = (*_UNEVEN, (1.0, longest))
    (low, least), (high, most) = next(pair for pair in pairwise(quantiles) if share <= pair[1][0])
    return least + (most - least) * (share - low) / (high - low)


def drop(reply: Reply, value: float) -> Parts:
    """The reply does not come."""
    return ()


def half(reply: Reply, value: float) -> Parts:
    """The first half of the reply comes, and then nothing."""
    return ((0.0, reply.frame[: len(reply.frame) // 2]),)


def pieces(reply: Reply, value: float) -> Parts:
    """The reply comes in three pieces, that far apart."""
    frame, third = reply.frame, len(reply.frame) // 3
    return ((0.0, frame[:third]), (value, frame[third:-third]), (2 * value, frame[-third:]))


def twice(reply: Reply, value: float) -> Parts:
    """The reply comes twice in one segment."""
    return ((0.0, 2 * reply.frame),)


def wrong_function(reply: Reply, value: float) -> Parts:
    """Reply as another function: 03 and 04 replace each other, as do 06 and 16; 03 replaces 23."""
    return reply.changed(pdu=bytes((_ANOTHER[reply.pdu[0]],)) + reply.pdu[1:])


def wrong_length(reply: Reply, value: float) -> Parts:
    """The reply has one register less, and a count that fits; one to a write lacks a byte."""
    pdu = reply.pdu
    return reply.changed(pdu=bytes((pdu[0], pdu[1] - 2)) + pdu[2:-2] if reply.has_registers else pdu[:-1])


def wrong_count(reply: Reply, value: float) -> Parts:
    """The reply announces two bytes more than it has; one to a write, another number of registers."""
    pdu = reply.pdu
    if not reply.has_registers:
        return reply.changed(pdu=pdu[:-1] + bytes((pdu[-1] ^ 1,)))
    return reply.changed(pdu=bytes((pdu[0], pdu[1] + 2)) + pdu[2:])


def wrong_transaction(reply: Reply, value: float) -> Parts:
    """The reply has the number of the transaction before."""
    number = (int.from_bytes(reply.frame[:2], "big") - 1) & 0xFFFF
    return ((0.0, number.to_bytes(2, "big") + reply.frame[2:]),)


def wrong_unit(reply: Reply, value: float) -> Parts:
    """The reply comes from the next unit."""
    return reply.changed(unit=(reply.unit + 1) & 0xFF)


def wrong_protocol(reply: Reply, value: float) -> Parts:
    """The header names another protocol than Modbus."""
    return ((0.0, reply.frame[:2] + b"\x00\x01" + reply.frame[4:]),)


def wrong_echo(reply: Reply, value: float) -> Parts:
    """The reply to a write names the register after the written one; a reply to FC23 names no register."""
    pdu = reply.pdu
    if reply.has_registers:
        return reply.changed()
    return reply.changed(pdu=pdu[:2] + bytes((pdu[2] ^ 1,)) + pdu[3:])


def wrong_checksum(reply: Reply, value: float) -> Parts:
    """One bit of the checksum is wrong."""
    return ((0.0, reply.frame[:-1] + bytes((reply.frame[-1] ^ 1,))),)


def byte_before(reply: Reply, value: float) -> Parts:
    """A byte comes first."""
    return ((0.0, bytes((int(value),)) + reply.frame),)


def byte_after(reply: Reply, value: float) -> Parts:
    """A byte comes last, as from a line that is not driven when the device stops sending."""
    return ((0.0, reply.frame + bytes((int(value),))),)


def seven_bits(reply: Reply, value: float) -> Parts:
    """The client's port is set to seven data bits."""
    return ((0.0, bytes(byte & 0x7F for byte in reply.frame)),)


def garbled(reply: Reply, value: float) -> Parts:
    """The rates differ: half as many bytes come, and none of them is right."""
    return ((0.0, bytes(byte ^ 0x0F | 0xE0 for byte in reply.frame[::2])),)


def refusal(reply: Reply, value: float) -> Parts:
    """An exception reply with this code comes instead."""
    return reply.changed(pdu=bytes((reply.pdu[0] | 0x80, int(value))))
