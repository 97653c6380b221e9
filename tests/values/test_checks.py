"""Argument checks: what is refused, and that the message names argument, value and range."""

from __future__ import annotations

import operator
import re
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
    check_number,
    check_seconds,
    check_timeout,
)
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import THREE_FINGER


class Broken:
    """Pretends to have an index, as an array of several does, and has none."""

    def __index__(self) -> int:
        raise TypeError("only integer scalar arrays can be converted to a scalar index")

    def __repr__(self) -> str:
        return "Broken()"


INTEGERS = [np.uint8(7), np.int64(7), np.array(7)]
NOT_INTEGERS = [
    *(1.0, float("nan"), True, "128", None, [1], Fraction(1), Broken()),
    *(np.float64(1), np.bool_(True), np.array([1]), np.array(True), np.str_("1"), np.timedelta64(1, "s")),
]
NAN, INF = float("nan"), float("inf")
REAL = [Fraction(1, 2), np.float16(0.5), np.float64(0.5), np.longdouble(0.5), np.uint8(2), 3600.0, 1]
NO_NUMBERS = [
    *("1", True, [1], 1j, Decimal("0.5"), Broken()),
    *(np.bool_(True), np.complex64(1), np.array([0.5]), np.str_("1"), np.timedelta64(1, "s")),
]
"""Some of them have a __float__."""


def refused(error: type[Exception], message: str) -> Any:
    return pytest.raises(error, match=f"^{re.escape(message)}")


# -- integers ----------------------------------------------------------------------------------------------


@given(st.integers(-1000, 1000), st.integers(-1000, 1000), st.integers(-1000, 1000))
def test_an_integer_passes_exactly_when_it_is_within_its_range(value: int, low: int, high: int) -> None:
    if low <= value <= high:
        assert check_int("n", value, low, high) == value
    else:
        with refused(ValueError, f"n must be in {low}..{high}, got {value}"):
            check_int("n", value, low, high)


@pytest.mark.parametrize("value", [-1, 256, 10**30])
def test_a_value_beyond_a_byte_is_a_value_error(value: int) -> None:
    assert (check_byte("force", 0), check_byte("force", 255)) == (0, 255)
    with refused(ValueError, f"force must be in 0..255, got {value}"):
        check_byte("force", value)


@pytest.mark.parametrize("value", [10**5000, -(10**5000)], ids=["large", "small"])
def test_an_integer_that_python_does_not_write_out_is_refused_with_its_argument(value: int) -> None:
    with refused(ValueError, "force must be in 0..255, got a number of 16610 bits"):
        check_byte("force", value)
    with refused(ValueError, "fingers must be a mask of Finger members in 1..15, got a number"):
        check_mask(value)
    with refused(ValueError, "finger must be one of Finger.A, B, C or SCISSOR (1, 2, 4 or 8), got a number"):
        check_axis(value)
    with refused(ValueError, "timeout must be seconds in 0..9, got a number"):
        check_seconds("timeout", value, 0, 9)


@pytest.mark.parametrize("value", NOT_INTEGERS, ids=repr)
def test_a_value_that_is_not_an_integer_is_a_type_error(value: object) -> None:
    with refused(TypeError, f"speed must be an int in 0..255, got {value!r}"):
        check_byte("speed", value)
    with refused(TypeError, f"fingers must be a Finger mask or an int in 1..15, got {value!r}"):
        check_mask(value)
    with refused(TypeError, f"finger must be one Finger (A, B, C or SCISSOR), got {value!r}"):
        check_axis(value)


@pytest.mark.parametrize("value", INTEGERS, ids=repr)
def test_an_integer_of_another_library_becomes_a_plain_one(value: SupportsIndex) -> None:
    for plain in (check_byte("speed", value), check_int("buffer", value, 1, 1000)):
        assert plain == operator.index(value)
        assert type(plain) is int
    assert check_mask(value) is Finger.ABC


def test_a_small_integer_of_numpy_does_not_wrap_in_the_comparison() -> None:
    with refused(ValueError, "n must be in 0..1000, got np.int8(-1)"):
        check_int("n", np.int8(-1), 0, 1000)
    assert check_int("n", np.uint8(255), 0, 1000) == 255


def test_an_array_of_numpy_without_dimensions_is_the_number_in_it() -> None:
    """The result of ``array.sum()`` or ``array[i]`` of some libraries."""
    assert check_byte("force", np.array(7, np.uint8)) == 7
    assert check_mask(np.array(7)) is Finger.ABC
    assert check_axis(np.array(8)) is Finger.SCISSOR
    for number in (
        check_seconds("timeout", np.array(0.25), 0, 9),
        check_number("mm", np.array(0.25, np.float32), 0, 9),
        check_timeout("timeout", np.array(0.25)),
    ):
        assert (number, type(number)) == (0.25, float)


@pytest.mark.parametrize(
    "value",
    [[1], [[1]], [], "1", True, None, 1j, np.timedelta64(1, "s"), np.datetime64(1, "s"), np.ma.masked],
)
def test_an_array_of_anything_else_is_refused(value: object) -> None:
    array = np.asarray(value) if value is not np.ma.masked else value
    for refuses in (check_byte, check_timeout if value is not None else check_byte):
        with pytest.raises(TypeError, match="must be"):
            refuses("force", array)


# -- masks and axes ----------------------------------------------------------------------------------------


@pytest.mark.parametrize("mask", range(-1, 18))
def test_a_mask_names_one_axis_or_several_and_no_other_bit(mask: int) -> None:
    for given_as in (mask, Finger(mask)) if mask > 0 else (mask,):
        if 1 <= mask <= 15:
            assert check_mask(given_as) == mask
            assert type(check_mask(given_as)) is Finger
        else:
            with refused(ValueError, f"fingers must be a mask of Finger members in 1..15, got {mask}"):
                check_mask(given_as)


@pytest.mark.parametrize("mask", range(-1, 18))
def test_an_axis_is_a_mask_of_one(mask: int) -> None:
    for given_as in (mask, Finger(mask), np.int64(mask)) if mask > 0 else (mask,):
        if mask in map(int, THREE_FINGER.axes):
            assert check_axis(given_as) is Finger(mask)
        else:
            words = "finger must be one of Finger.A, B, C or SCISSOR (1, 2, 4 or 8), got"
            with refused(ValueError, f"{words} {given_as!r}"):
                check_axis(given_as)


# -- registers ---------------------------------------------------------------------------------------------


@given(st.lists(st.integers(0, 0xFFFF), min_size=8, max_size=8))
def test_eight_registers_become_a_tuple_of_plain_integers(block: list[int]) -> None:
    forms: list[Any] = [block, tuple(block), np.array(block, np.uint16)]
    for given_as in forms:
        checked = reg.check_registers(given_as)
        assert checked == tuple(block)
        assert {type(each) for each in checked} == {int}


@pytest.mark.parametrize("register", [1.0, True, np.float64(1), "1", None], ids=repr)
def test_a_register_that_is_not_an_integer_is_a_type_error(register: Any) -> None:
    with refused(TypeError, f"registers[2] must be an int in 0..65535, got {register!r}"):
        reg.check_registers([0, 0, register, 0, 0, 0, 0, 0])


def test_other_than_eight_registers_of_sixteen_bits_is_a_value_error() -> None:
    for count in (0, 7, 9):
        with pytest.raises(ValueError, match=f"expected 8 of them, got {count}"):
            reg.check_registers([0] * count)
    for register in (-1, 0x10000):
        with refused(ValueError, f"registers[3] must be in 0..65535, got {register}"):
            reg.check_registers([0, 0, 0, register, 0, 0, 0, 0])


# -- seconds -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.01, 5, *REAL[:5]], ids=repr)
def test_seconds_within_the_range_pass_as_a_float(value: float) -> None:
    assert check_seconds("poll_interval", value, 0.01, 5.0) == value
    assert type(check_seconds("poll_interval", value, 0.01, 5.0)) is float


@pytest.mark.parametrize("value", [0.00999, 5.0001, NAN, INF, np.float32(NAN), np.int8(-1)], ids=repr)
def test_seconds_outside_the_range_are_a_value_error(value: float) -> None:
    with refused(ValueError, f"poll_interval must be seconds in 0.01..5.0, got {value!r}"):
        check_seconds("poll_interval", value, 0.01, 5.0)


@pytest.mark.parametrize("value", REAL, ids=repr)
def test_a_timeout_above_zero_becomes_a_float_and_none_stays_none(value: float) -> None:
    assert check_timeout("timeout", value) == value
    assert type(check_timeout("timeout", value)) is float
    assert check_timeout("timeout", None) is None


@pytest.mark.parametrize("value", [0, -1, NAN, INF, np.float16(NAN), np.int8(-1)], ids=repr)
def test_a_time_out_that_is_not_above_zero_is_a_value_error(value: float) -> None:
    with refused(ValueError, f"timeout must be None or seconds above 0, got {value!r}"):
        check_timeout("timeout", value)


@pytest.mark.parametrize("value", NO_NUMBERS, ids=repr)
def test_seconds_that_are_not_a_number_are_a_type_error(value: object) -> None:
    with refused(TypeError, f"poll_interval must be seconds in 0.01..5.0, got {value!r}"):
        check_seconds("poll_interval", value, 0.01, 5.0)
    with refused(TypeError, f"timeout must be None or seconds above 0, got {value!r}"):
        check_timeout("timeout", value)


def test_seconds_beyond_every_float_are_a_value_error() -> None:
    with pytest.raises(ValueError, match="poll_interval"):
        check_seconds("poll_interval", 10**400, 0.01, 5.0)
    with pytest.raises(ValueError, match="timeout"):
        check_timeout("timeout", 10**400)
