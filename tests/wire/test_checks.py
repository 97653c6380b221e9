"""Argument checks: what is refused, and that the message tells argument, value and range."""

from __future__ import annotations

import enum
import operator
import re
from collections.abc import Callable
from decimal import Decimal
from fractions import Fraction
from typing import Any, SupportsIndex

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.values import registers as reg
from robotiq_async.values.checks import (
    check_axis,
    check_byte,
    check_int,
    check_mask,
    check_seconds,
    check_timeout,
)
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import THREE_FINGER


class Index:
    """An integer of another library: it has an index, but it is not an int."""

    def __index__(self) -> int:
        return 7

    def __repr__(self) -> str:
        return "Index(7)"


class Speed(enum.IntEnum):
    FAST = 200


class Broken:
    """Says that it has an index, as an array of several does, and has none."""

    def __index__(self) -> int:
        raise TypeError("only integer scalar arrays can be converted to a scalar index")

    def __repr__(self) -> str:
        return "Broken()"


NOT_INTEGERS = [
    *(1.0, 128.5, float("nan"), True, False, "128", b"\x01", None, [1], (), 1j, Fraction(1), Broken()),
    *(np.float64(1), np.bool_(True), np.array([1]), np.array(True), np.str_("1"), np.timedelta64(1, "s")),
]
NAN, INF = float("nan"), float("inf")
REAL = [Fraction(1, 2), np.float16(0.5), np.float32(0.5), np.float64(0.5), np.longdouble(0.5), np.uint8(2)]
NO_NUMBERS = [
    *("1", True, False, [1], 1j, Decimal("0.5"), Broken()),
    *(np.bool_(True), np.complex64(1), np.array([0.5]), np.str_("1"), np.timedelta64(1, "s")),
]
"""Some of them have a __float__."""


# -- positions, speeds, forces -----------------------------------------------------------------------------


@given(st.integers(0, 255))
def test_every_byte_passes_unchanged(value: int) -> None:
    assert check_byte("speed", value) == value


@pytest.mark.parametrize("value", NOT_INTEGERS, ids=repr)
def test_what_is_not_an_integer_is_a_type_error_that_names_argument_value_and_range(value: object) -> None:
    with pytest.raises(TypeError) as caught:
        check_byte("speed", value)
    for part in ("speed", repr(value), "0..255"):
        assert part in str(caught.value)


@pytest.mark.parametrize("value", [-1, 256, -(10**30), 10**30])
def test_what_does_not_fit_into_a_byte_is_a_value_error_that_names_argument_value_and_range(
    value: int,
) -> None:
    with pytest.raises(ValueError, match=re.escape("0..255")) as caught:
        check_byte("force", value)
    for part in ("force", repr(value)):
        assert part in str(caught.value)


INTEGERS = [7, Index(), np.uint8(7), np.int16(7), np.int64(7), np.uint64(7), np.array(7)]


@pytest.mark.parametrize("value", [Speed.FAST, *INTEGERS], ids=repr)
def test_whatever_is_an_integer_becomes_a_plain_one(value: SupportsIndex) -> None:
    for plain in (check_byte("speed", value), check_int("buffer", value, 1, 1000)):
        assert plain == operator.index(value)
        assert type(plain) is int


def test_a_small_integer_of_numpy_does_not_wrap_in_the_comparison() -> None:
    with pytest.raises(ValueError, match=re.escape("n must be in 0..1000, got np.int8(-1)")):
        check_int("n", np.int8(-1), 0, 1000)
    assert check_int("n", np.uint8(255), 0, 1000) == 255


@given(st.integers(-1000, 1000), st.integers(-1000, 1000), st.integers(-1000, 1000))
def test_an_integer_passes_exactly_when_it_is_within_its_range(value: int, low: int, high: int) -> None:
    if low <= value <= high:
        assert check_int("n", value, low, high) == value
    else:
        with pytest.raises(ValueError, match=re.escape(f"n must be in {low}..{high}, got {value}")):
            check_int("n", value, low, high)


# -- masks and axes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mask", range(1, 16))
def test_every_mask_of_axes_passes_as_a_finger_or_as_an_integer(mask: int) -> None:
    for given_as in (mask, Finger(mask)):
        assert check_mask(given_as) == mask
        assert type(check_mask(given_as)) is Finger


@pytest.mark.parametrize("mask", INTEGERS, ids=repr)
def test_a_mask_may_be_an_integer_of_others(mask: SupportsIndex) -> None:
    assert check_mask(mask) is Finger.ABC


@pytest.mark.parametrize("mask", [0, Finger(0), 16, 17, -1, 255, Finger(16)], ids=repr)
def test_an_empty_mask_or_one_with_other_bits_is_a_value_error(mask: int) -> None:
    with pytest.raises(ValueError, match=re.escape("1..15")) as caught:
        check_mask(mask)
    assert "fingers" in str(caught.value)
    assert str(int(mask)) in str(caught.value)


@pytest.mark.parametrize("mask", NOT_INTEGERS, ids=repr)
def test_what_is_not_a_mask_is_a_type_error(mask: object) -> None:
    with pytest.raises(TypeError, match=re.escape("1..15")) as caught:
        check_mask(mask)
    assert "fingers" in str(caught.value)
    assert repr(mask) in str(caught.value)


@pytest.mark.parametrize("axis", THREE_FINGER.axes)
def test_every_axis_passes_as_a_finger_or_as_an_integer(axis: Finger) -> None:
    assert check_axis(axis) is axis
    assert check_axis(int(axis)) is axis


@pytest.mark.parametrize("axis", [np.int64(8), np.uint8(8)], ids=repr)
def test_an_axis_may_be_an_integer_of_others(axis: object) -> None:
    assert check_axis(axis) is Finger.SCISSOR


@pytest.mark.parametrize("mask", sorted({*range(-1, 17)} - {1, 2, 4, 8}))
def test_a_mask_is_not_an_axis(mask: int) -> None:
    for given_as in (mask, Finger(mask)) if mask > 0 else (mask,):
        with pytest.raises(ValueError, match="one of") as caught:
            check_axis(given_as)
        for part in ("finger", repr(given_as), "A, B, C or SCISSOR"):
            assert part in str(caught.value)


@pytest.mark.parametrize("axis", NOT_INTEGERS, ids=repr)
def test_what_is_not_an_axis_is_a_type_error(axis: object) -> None:
    with pytest.raises(TypeError) as caught:
        check_axis(axis)
    for part in ("finger", repr(axis), "A, B, C or SCISSOR"):
        assert part in str(caught.value)


# -- registers ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("make", [list, tuple, np.array, lambda words: np.array(words, np.uint16)])
def test_registers_become_plain_integers_whatever_they_come_in(make: Callable[[list[int]], Any]) -> None:
    words = [0xF900, 0, 1, 2, 3, 4, 5, 0xFFFF]
    assert reg.check_registers(make(words)) == tuple(words)
    assert {type(each) for each in reg.check_registers(make(words))} == {int}


@pytest.mark.parametrize("register", [1.0, True, np.bool_(True), np.float64(1), "1", None], ids=repr)
def test_what_is_no_register_is_a_type_error(register: Any) -> None:
    with pytest.raises(
        TypeError, match=re.escape(f"registers[2] must be an int in 0..65535, got {register!r}")
    ):
        reg.check_registers([0, 0, register, 0, 0, 0, 0, 0])


# -- seconds -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.01, 0.5, 1, 5, 5.0, *REAL], ids=repr)
def test_seconds_within_the_range_pass_as_a_float(value: float) -> None:
    assert check_seconds("poll_interval", value, 0.01, 5.0) == value
    assert type(check_seconds("poll_interval", value, 0.01, 5.0)) is float


@pytest.mark.parametrize(
    "value", [0, 0.00999, 5.0001, -1, NAN, INF, -INF, *map(np.float32, (NAN, INF, 6)), np.int8(-1)], ids=repr
)
def test_seconds_outside_the_range_are_a_value_error(value: float) -> None:
    with pytest.raises(ValueError, match=re.escape("0.01..5.0")) as caught:
        check_seconds("poll_interval", value, 0.01, 5.0)
    assert "poll_interval" in str(caught.value)
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("value", [None, *NO_NUMBERS], ids=repr)
def test_what_is_not_a_number_of_seconds_is_a_type_error(value: object) -> None:
    with pytest.raises(TypeError, match=re.escape("0.01..5.0")) as caught:
        check_seconds("poll_interval", value, 0.01, 5.0)
    assert "poll_interval" in str(caught.value)
    assert repr(value) in str(caught.value)


def test_a_number_of_others_becomes_a_plain_float() -> None:
    for value in REAL:
        assert type(check_timeout("timeout", value)) is float


def test_no_time_out_is_none() -> None:
    assert check_timeout("timeout", None) is None


@pytest.mark.parametrize("value", [1e-9, 1, 3600.0, *REAL], ids=repr)
def test_a_time_out_above_zero_passes(value: float) -> None:
    assert check_timeout("timeout", value) == value


@pytest.mark.parametrize("value", [0, 0.0, -1, NAN, INF, np.float16(NAN), np.int8(-1)], ids=repr)
def test_a_time_out_that_is_not_above_zero_is_a_value_error(value: float) -> None:
    with pytest.raises(ValueError, match="timeout must be None or seconds above 0") as caught:
        check_timeout("timeout", value)
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_what_is_not_a_time_out_is_a_type_error(value: object) -> None:
    with pytest.raises(TypeError, match="timeout must be None or seconds above 0") as caught:
        check_timeout("timeout", value)
    assert repr(value) in str(caught.value)


def test_seconds_beyond_every_float_are_a_value_error() -> None:
    with pytest.raises(ValueError, match="poll_interval"):
        check_seconds("poll_interval", 10**400, 0.01, 5.0)


def test_a_time_out_beyond_every_float_is_a_value_error() -> None:
    with pytest.raises(ValueError, match="timeout"):
        check_timeout("timeout", 10**400)
