"""Corruptions of the bytes of a reply: the frames are made by hand, on both kinds of link."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robotiq_async.simulator import Trouble
from robotiq_async.simulator.troubles.corruption import Parts, Reply
from robotiq_async.simulator.troubles.trouble import KINDS
from tests.serial_line import with_crc

READ = "04 04 1234 5678"
"""Two registers, as an answer to FC04."""
WRITE = "10 03e8 0002"
"""Two registers from 1000 on are written, by FC16."""
WRITE_ONE = "06 03e9 1234"
READ_WRITE = "17 04 1234 5678"


def tcp(pdu: str, *, transaction: str = "0a0b", protocol: str = "0000", unit: str = "09") -> bytes:
    """A Modbus TCP frame."""
    body = bytes.fromhex(unit + pdu)
    return bytes.fromhex(transaction + protocol) + bytes((0, len(body))) + body


def rtu(pdu: str, *, unit: str = "09") -> bytes:
    """A Modbus RTU frame."""
    return with_crc(bytes.fromhex(unit + pdu))


def corrupted(kind: str, frame: bytes, *, serial: bool = False, value: float | None = None) -> Parts:
    """A frame after a kind of trouble."""
    corruption = KINDS[kind].corruption
    assert corruption is not None
    return corruption(Reply(frame, serial), Trouble(kind, value).amount)


def at_once(frame: bytes) -> list[tuple[float, bytes]]:
    return [(0.0, frame)]


# What is known of a reply.


@pytest.mark.parametrize(
    ("pdu", "is_to_a_write"),
    [
        *((READ, False), ("03 02 1234", False), ("83 02", False), ("84 02", False)),
        (READ_WRITE, True),
        *((WRITE, True), (WRITE_ONE, True), ("86 02", True), ("90 02", True)),
    ],
)
def test_a_reply(pdu: str, is_to_a_write: bool) -> None:
    for reply in (Reply(tcp(pdu), serial=False), Reply(rtu(pdu), serial=True)):
        assert reply.unit == 9
        assert reply.pdu == bytes.fromhex(pdu)
        assert reply.is_to_a_write is is_to_a_write


# The PDU or the unit is wrong; length and checksum fit it.


@pytest.mark.parametrize(
    ("kind", "pdu", "wrong"),
    [
        ("wrong-function", READ, "03 04 1234 5678"),
        ("wrong-function", "03 02 1234", "04 02 1234"),
        ("wrong-function", READ_WRITE, "03 04 1234 5678"),
        ("wrong-length", READ_WRITE, "17 02 1234"),
        ("wrong-count", READ_WRITE, "17 06 1234 5678"),
        ("wrong-function", WRITE, "06 03e8 0002"),
        ("wrong-function", WRITE_ONE, "10 03e9 1234"),
        ("wrong-length", READ, "04 02 1234"),
        ("wrong-length", "03 02 1234", "03 00"),
        ("wrong-length", WRITE, "10 03e8 00"),
        ("wrong-length", WRITE_ONE, "06 03e9 12"),
        ("wrong-count", READ, "04 06 1234 5678"),
        ("wrong-count", WRITE, "10 03e8 0003"),
        ("wrong-count", WRITE_ONE, "06 03e9 1235"),
        ("wrong-echo", WRITE, "10 03e9 0002"),
        ("wrong-echo", WRITE_ONE, "06 03e8 1234"),
    ],
)
def test_only_the_pdu_is_wrong(kind: str, pdu: str, wrong: str) -> None:
    assert list(corrupted(kind, tcp(pdu))) == at_once(tcp(wrong))
    assert list(corrupted(kind, rtu(pdu), serial=True)) == at_once(rtu(wrong))


@pytest.mark.parametrize(("pdu", "unit", "wrong"), [(READ, "09", "0a"), (WRITE, "ff", "00")])
def test_only_the_unit_is_wrong(pdu: str, unit: str, wrong: str) -> None:
    assert list(corrupted("wrong-unit", tcp(pdu, unit=unit))) == at_once(tcp(pdu, unit=wrong))
    assert list(corrupted("wrong-unit", rtu(pdu, unit=unit), serial=True)) == at_once(rtu(pdu, unit=wrong))


@pytest.mark.parametrize(
    ("pdu", "value", "refused"),
    [(READ, None, "84 04"), (WRITE, None, "90 04"), (WRITE_ONE, 2, "86 02"), (READ, 255, "84 ff")],
)
def test_a_refusal_in_place_of_the_reply(pdu: str, value: int | None, refused: str) -> None:
    assert list(corrupted("exception", tcp(pdu), value=value)) == at_once(tcp(refused))


# The frame around it is wrong.


@pytest.mark.parametrize(
    ("pdu", "transaction", "wrong"),
    [(READ, "0a0b", "0a0a"), (WRITE, "0100", "00ff"), (READ, "0001", "0000"), (WRITE, "0000", "ffff")],
)
def test_only_the_transaction_is_wrong(pdu: str, transaction: str, wrong: str) -> None:
    frame, expected = tcp(pdu, transaction=transaction), tcp(pdu, transaction=wrong)
    assert list(corrupted("wrong-transaction", frame)) == at_once(expected)


@pytest.mark.parametrize("pdu", [READ, WRITE])
def test_only_the_protocol_is_wrong(pdu: str) -> None:
    assert list(corrupted("wrong-protocol", tcp(pdu))) == at_once(tcp(pdu, protocol="0001"))


@pytest.mark.parametrize("pdu", [READ, WRITE])
def test_only_the_checksum_is_wrong(pdu: str) -> None:
    frame = rtu(pdu)
    ((delay, wrong),) = corrupted("wrong-checksum", frame, serial=True)
    assert delay == 0
    assert wrong[:-2] == frame[:-2]
    assert (int.from_bytes(wrong[-2:], "big") ^ int.from_bytes(frame[-2:], "big")).bit_count() == 1


@pytest.mark.parametrize("pdu", [READ, WRITE])
def test_a_byte_too_many(pdu: str) -> None:
    frame = rtu(pdu)
    assert list(corrupted("byte-before", frame, serial=True)) == at_once(b"\0" + frame)
    assert list(corrupted("byte-after", frame, serial=True, value=255)) == at_once(frame + b"\xff")


def test_another_setting_of_the_port() -> None:
    frame = rtu("03 02 82ff")
    ((_, seven),) = corrupted("seven-bits", frame, serial=True)
    assert [byte & 0x7F for byte in frame] == list(seven) != list(frame)
    ((_, garbled),) = corrupted("garbled", frame, serial=True)
    assert len(garbled) < len(frame)
    assert not set(garbled) & set(frame)


# The frame is in order, but not how it comes.

FRAMES = [(tcp(READ), False), (tcp(WRITE), False), (rtu(READ), True), (rtu(WRITE), True)]
FRAME_NAMES = ["tcp read", "tcp write", "rtu read", "rtu write"]
on_every_frame = pytest.mark.parametrize(("frame", "serial"), FRAMES, ids=FRAME_NAMES)


@on_every_frame
@pytest.mark.parametrize(
    ("kind", "value", "comes"),
    [
        ("delay", None, lambda frame: [(0.05, frame)]),
        ("delay", 0.3, lambda frame: [(0.3, frame)]),
        ("late", None, lambda frame: [(0.7, frame)]),
        ("drop", None, lambda _: []),
        ("half", None, lambda frame: at_once(frame[: len(frame) // 2])),
        ("twice", None, lambda frame: at_once(frame + frame)),
    ],
)
def test_how_it_comes(
    frame: bytes, serial: bool, kind: str, value: float | None, comes: Callable[[bytes], Parts]
) -> None:
    assert list(corrupted(kind, frame, serial=serial, value=value)) == comes(frame)


@on_every_frame
@pytest.mark.parametrize(("value", "apart"), [(None, 0.002), (0.3, 0.3), (0, 0)])
def test_it_comes_in_three_pieces(frame: bytes, serial: bool, value: float | None, apart: float) -> None:
    parts = corrupted("pieces", frame, serial=serial, value=value)
    assert [delay for delay, _ in parts] == [0, apart, 2 * apart]
    assert all(len(part) >= 2 for _, part in parts)
    assert b"".join(part for _, part in parts) == frame
