"""The two blocks, bit by bit after the manual."""

from __future__ import annotations

import re
from collections.abc import Iterator

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.values import registers as reg
from tests.register_words import REQUEST_RESERVED, bytes_of, registers_of
from tests.strategies import BLOCKS

REQUEST = {
    "rACT": (0, 0, 1),
    "rMOD": (0, 1, 2),
    "rGTO": (0, 3, 1),
    "rATR": (0, 4, 1),
    "rICF": (1, 2, 1),
    "rICS": (1, 3, 1),
    "rPR": [(3, 0, 8), (6, 0, 8), (9, 0, 8), (12, 0, 8)],
    "rSP": [(4, 0, 8), (7, 0, 8), (10, 0, 8), (13, 0, 8)],
    "rFR": [(5, 0, 8), (8, 0, 8), (11, 0, 8), (14, 0, 8)],
}
"""Byte, lowest bit and width of each request field in the manual; the lists are A, B, C, scissor."""
STATUS = {
    "gACT": (0, 0, 1),
    "gMOD": (0, 1, 2),
    "gGTO": (0, 3, 1),
    "gIMC": (0, 4, 2),
    "gSTA": (0, 6, 2),
    "gDT": [(1, 0, 2), (1, 2, 2), (1, 4, 2), (1, 6, 2)],
    "gFLT": (2, 0, 4),
    "gPR": [(3, 0, 8), (6, 0, 8), (9, 0, 8), (12, 0, 8)],
    "gPO": [(4, 0, 8), (7, 0, 8), (10, 0, 8), (13, 0, 8)],
    "gCU": [(5, 0, 8), (8, 0, 8), (11, 0, 8), (14, 0, 8)],
}
"""The same of the status."""


def flat(value: object) -> Iterator[reg.Field]:
    for each in value if isinstance(value, tuple) else (value,):
        assert isinstance(each, reg.Field)
        yield each


def fields_of(table: dict[str, object]) -> list[reg.Field]:
    return [field for name in table for field in flat(getattr(reg, name))]


ALL_FIELDS = [*fields_of({**REQUEST}), *fields_of({**STATUS})]


def test_a_field_lies_where_the_manual_says() -> None:
    for name, place in [*REQUEST.items(), *STATUS.items()]:
        places = [(each.byte, each.shift, each.width) for each in flat(getattr(reg, name))]
        assert places == (place if isinstance(place, list) else [place]), name


def test_no_other_fields_are_defined() -> None:
    names = {name for name in vars(reg) if re.fullmatch(r"[rg][A-Z]+", name)}
    assert names == {*REQUEST, *STATUS, "rARD", "gOBJ"}  # these two are the siblings'


def test_the_request_fields_leave_the_reserved_bits_alone() -> None:
    covered = [0] * 16
    for field in fields_of({**REQUEST}):
        covered[field.byte] |= ((1 << field.width) - 1) << field.shift
    assert tuple(0xFF ^ byte for byte in covered) == REQUEST_RESERVED


def test_even_bytes_are_the_high_half_of_a_register_and_odd_ones_the_low_half() -> None:
    block = registers_of(range(16))
    assert block == (0x0001, 0x0203, 0x0405, 0x0607, 0x0809, 0x0A0B, 0x0C0D, 0x0E0F)
    assert [reg.Field(byte).read(block) for byte in range(16)] == list(range(16))


def test_the_manual_s_status_of_a_held_object_reads_as_it_says() -> None:
    block = (0xB9EA, *(0,) * 7)
    values = {name: getattr(reg, name).read(block) for name in ("gACT", "gMOD", "gGTO", "gIMC", "gSTA")}
    assert values == {"gACT": 1, "gMOD": 0, "gGTO": 1, "gIMC": 3, "gSTA": 2}
    assert [field.read(block) for field in reg.gDT] == [2, 2, 2, 3]


@given(BLOCKS, st.sampled_from(ALL_FIELDS), st.integers(0, 255))
def test_a_field_that_is_written_reads_the_same_and_changes_no_other_bit(
    before: tuple[int, ...], field: reg.Field, number: int
) -> None:
    value = number & (1 << field.width) - 1
    block = list(before)
    field.write(block, value)
    assert field.read(block) == value
    mask = ((1 << field.width) - 1) << field.shift
    for index, (old, new) in enumerate(zip(bytes_of(before), bytes_of(block), strict=True)):
        assert old & ~mask == new & ~mask if index == field.byte else old == new
    assert all(0 <= register <= 0xFFFF for register in block)


def test_a_value_that_does_not_fit_is_refused_and_leaves_no_trace() -> None:
    block = [0x5A5A] * 8
    for field in ALL_FIELDS:
        for value in (-1, 1 << field.width):
            with pytest.raises(ValueError, match=str(value)):
                field.write(block, value)
    assert block == [0x5A5A] * 8


def test_the_current_counts_ten_milliampere() -> None:
    assert reg.MILLIAMPERE_PER_COUNT * 0x0F == 150


def test_over_tcp_both_blocks_begin_at_zero_and_function_four_reads() -> None:
    assert reg.RegisterMap(request=0, status=0, read_function=4, device_id=2) == reg.TCP_REGISTERS


def test_over_rtu_the_blocks_lie_where_the_manual_says_and_function_three_reads() -> None:
    assert reg.RegisterMap(request=1000, status=2000, read_function=3, device_id=9) == reg.RTU_REGISTERS
