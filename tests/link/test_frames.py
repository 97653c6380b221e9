"""Every byte of a reply: frames of the Modbus specification, whole, cut, longer and corrupted."""

from __future__ import annotations

from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.link.frames import CHECKSUM, expected_over_tcp, expected_reply
from robotiq_async.link.outcome import Noise, Refused
from tests.serial_line import with_crc

TRANSACTION = "12 34"
VALUES = "31 00 00 00 ff 06 00 00 07 00 00 06 00 00 89 00"
IMAGE = "09 0c 00 11 12 13 21 22 23 31 32 33 41 42 43 00"


class Case:
    """A request frame, its good reply, and which bytes of that can be checked."""

    def __init__(self, request: str, reply: str, *, serial: bool, checked: range, function: int) -> None:
        self.request = bytes.fromhex(request)
        self.reply = with_crc(bytes.fromhex(reply)) if serial else bytes.fromhex(reply)
        self.serial = serial
        self.checked = checked
        self.function = function

    def verdict(self, frame: bytes) -> bytes | Refused | Noise | None:
        """The verdict on the bytes of a reply so far."""
        if self.serial:
            return expected_reply(self.request, checksum=CHECKSUM).verdict(frame)
        header, request = self.request[:4], self.request[6:]
        return expected_over_tcp(request).after(header).verdict(frame)

    def body(self, reply: bytes) -> bytes:
        """From the function code on."""
        return reply[1:-CHECKSUM] if self.serial else reply[7:]


CASES = {
    "tcp read": Case(
        f"{TRANSACTION} 00 00 00 06 02 04 00 00 00 08",
        f"{TRANSACTION} 00 00 00 13 02 04 10 {VALUES}",
        serial=False,
        checked=range(9),
        function=4,
    ),
    "tcp write": Case(
        f"{TRANSACTION} 00 00 00 17 02 10 00 00 00 08 10 {IMAGE}",
        f"{TRANSACTION} 00 00 00 06 02 10 00 00 00 08",
        serial=False,
        checked=range(12),
        function=16,
    ),
    "tcp read of holding registers": Case(
        f"{TRANSACTION} 00 00 00 06 02 03 07 d0 00 08",
        f"{TRANSACTION} 00 00 00 13 02 03 10 {VALUES}",
        serial=False,
        checked=range(9),
        function=3,
    ),
    "rtu read": Case("09 03 07 d0 00 08", f"09 03 10 {VALUES}", serial=True, checked=range(3), function=3),
    "rtu write": Case(
        f"09 10 03 e8 00 08 10 {IMAGE}",
        "09 10 03 e8 00 08",
        serial=True,
        checked=range(6),
        function=16,
    ),
    "rtu probe of three registers": Case(
        "09 03 07 d0 00 03",
        "09 03 06 31 00 00 00 ff 06",
        serial=True,
        checked=range(3),
        function=3,
    ),
}

every_case = pytest.mark.parametrize("case", CASES.values(), ids=CASES)


def exception_reply(case: Case, code: int) -> bytes:
    refusal = bytes((case.function | 0x80, code))
    if case.serial:
        return with_crc(case.reply[:1] + refusal)
    return case.reply[:4] + b"\x00\x03" + case.reply[6:7] + refusal


def corrupted(frame: bytes, positions: range) -> Iterator[tuple[int, bytes]]:
    """The frame with one byte changed: every position, every other value."""
    for position in positions:
        for change in range(1, 256):
            yield position, frame[:position] + bytes((frame[position] ^ change,)) + frame[position + 1 :]


def is_ever_complete(case: Case, frame: bytes) -> bool:
    """Whether any of the growing beginnings of a frame is taken for the whole answer."""
    for end in range(len(frame) + 1):
        if (verdict := case.verdict(frame[:end])) is not None:
            return isinstance(verdict, bytes)
    return False


def noise(case: Case, frame: bytes) -> str:
    """The words about bytes that are not the answer."""
    verdict = case.verdict(frame)
    assert isinstance(verdict, Noise), verdict
    return verdict.error.message


# -- the good reply ----------------------------------------------------------------------------------------


@every_case
def test_a_good_reply_is_complete_with_its_last_byte_and_not_before(case: Case) -> None:
    for end in range(len(case.reply)):
        assert case.verdict(case.reply[:end]) is None
    assert case.verdict(case.reply) == case.body(case.reply)


@every_case
def test_a_good_reply_with_something_behind_it_is_refused(case: Case) -> None:
    for more in (b"\x00", b"\xff" * 3, case.reply):
        assert noise(case, case.reply + more).startswith(f"{len(more)} bytes more")


@every_case
def test_the_values_that_are_read_are_not_looked_at(case: Case) -> None:
    """There is nothing to compare them with; TCP or the checksum of RTU vouches for them."""
    if case.function == 16:
        return
    start = case.checked.stop
    count = case.reply[start - 1]
    for byte in range(256):
        reply = case.reply[:start] + bytes((byte,)) * count
        reply = with_crc(reply) if case.serial else reply
        assert case.verdict(reply) == case.body(reply), f"{byte:02x}"


@pytest.mark.parametrize("case", [case for case in CASES.values() if case.serial])
def test_a_wrong_checksum_is_noise_and_refuses_nothing(case: Case) -> None:
    for reply in (case.reply, exception_reply(case, 2)):
        for _, frame in corrupted(reply, range(len(reply) - CHECKSUM, len(reply))):
            assert noise(case, frame).startswith("a wrong checksum: ")


# -- one wrong byte ----------------------------------------------------------------------------------------


def test_the_bytes_that_can_be_checked_are_all_but_values_and_check_sums() -> None:
    for case in CASES.values():
        unchecked = len(case.reply) - len(case.checked)
        values = 0 if case.function == 16 else 2 * int.from_bytes(case.request[-2:])
        assert unchecked == values + (2 if case.serial else 0)


@every_case
def test_a_reply_with_one_wrong_byte_is_refused_at_once_and_as_soon_as_the_byte_is_seen(case: Case) -> None:
    count = 0
    for position, frame in corrupted(case.reply, case.checked):
        assert not is_ever_complete(case, frame), f"byte {position}: {frame.hex(' ')}"
        assert isinstance(case.verdict(frame), Noise)
        if not exception_reply(case, 2).startswith(frame[: position + 1]):  # which it may still become
            assert noise(case, frame[: position + 1]).startswith("not the answer")
        count += 1
    assert count == 255 * len(case.checked)


@every_case
def test_no_exception_reply_with_one_wrong_byte_is_ever_taken_for_the_answer(case: Case) -> None:
    good = exception_reply(case, 2)
    for _, frame in corrupted(good, range(len(good))):
        assert not is_ever_complete(case, frame)


@given(st.sampled_from([*CASES.values()]), st.binary(max_size=40))
def test_noise_is_never_taken_for_the_answer(case: Case, frame: bytes) -> None:
    assert frame[: case.checked.stop] == case.reply[: case.checked.stop] or not is_ever_complete(case, frame)


# -- the wrong answer --------------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("asked", "answered"),
    [
        ("tcp read", "tcp write"),
        ("tcp write", "tcp read"),
        ("rtu read", "rtu write"),
        ("rtu write", "rtu read"),
        ("rtu read", "rtu probe of three registers"),
        ("rtu probe of three registers", "rtu read"),
    ],
)
def test_the_answer_to_the_other_kind_of_request_is_refused(asked: str, answered: str) -> None:
    assert noise(CASES[asked], CASES[answered].reply).startswith("not the answer")


@pytest.mark.parametrize("count", sorted(set(range(1, 9)) - {3}))
def test_a_late_answer_of_another_length_is_not_that_of_a_probe(count: int) -> None:
    case = CASES["rtu probe of three registers"]
    late = bytes((9, 3, 2 * count)) + bytes(2 * count) + b"\xaa\xbb"
    assert not is_ever_complete(case, late)


# -- exception replies -------------------------------------------------------------------------------------


@every_case
def test_an_exception_reply_is_a_protocol_error_that_tells_function_and_code(case: Case) -> None:
    for code in (1, 2, 3, 4, 6, 11, 99):
        verdict = case.verdict(exception_reply(case, code))
        assert isinstance(verdict, Refused)
        assert verdict.code == code
        assert f"refuses function {case.function}: exception {code} " in verdict.error.message
        assert ("illegal data address" in verdict.error.message) is (code == 2)


@every_case
def test_an_exception_reply_that_comes_in_pieces_is_never_an_answer(case: Case) -> None:
    reply = exception_reply(case, 2)
    assert not is_ever_complete(case, reply)
    # It is known for what it is, and waited for.
    for end in range(len(reply)):
        assert case.verdict(reply[:end]) is None
