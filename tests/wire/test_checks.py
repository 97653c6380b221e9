"""Argument checks: what is refused, and that the message tells argument, value and range."""

from __future__ import annotations

import enum
import re
from fractions import Fraction

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.enums import AXES, Finger
from robotiq_async.wire.checks import (
    check_axis,
    check_byte,
    check_int,
    check_mask,
    check_seconds,
    check_timeout,
)


class Index:
    """An integer of another library: it has an index, but it is not an int."""

    def __index__(self) -> int:
        return 7

    def __repr__(self) -> str:
        return "Index(7)"


class Speed(enum.IntEnum):
    FAST = 200


NOT_INTEGERS = [1.0, 128.5, float("nan"), True, False, "128", b"\x01", None, [1], (), 1j, Index()]
NAN, INF = float("nan"), float("inf")


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


def test_an_enumerated_integer_becomes_a_plain_one() -> None:
    assert check_byte("speed", Speed.FAST) == 200
    assert type(check_byte("speed", Speed.FAST)) is int


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


@pytest.mark.parametrize("axis", AXES)
def test_every_axis_passes_as_a_finger_or_as_an_integer(axis: Finger) -> None:
    assert check_axis(axis) is axis
    assert check_axis(int(axis)) is axis


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


# -- seconds -----------------------------------------------------------------------------------------------


@pytest.mark.parametrize("value", [0.01, 0.5, 1, 5, 5.0])
def test_seconds_within_the_range_pass_as_a_float(value: float) -> None:
    assert check_seconds("poll_interval", value, 0.01, 5.0) == value
    assert type(check_seconds("poll_interval", value, 0.01, 5.0)) is float


@pytest.mark.parametrize("value", [0, 0.00999, 5.0001, -1, NAN, INF, -INF])
def test_seconds_outside_the_range_are_a_value_error(value: float) -> None:
    with pytest.raises(ValueError, match=re.escape("0.01..5.0")) as caught:
        check_seconds("poll_interval", value, 0.01, 5.0)
    assert "poll_interval" in str(caught.value)
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("value", ["1", True, None, Fraction(1, 2), Index(), [1]], ids=repr)
def test_what_is_not_a_number_of_seconds_is_a_type_error(value: object) -> None:
    with pytest.raises(TypeError, match=re.escape("0.01..5.0")) as caught:
        check_seconds("poll_interval", value, 0.01, 5.0)
    assert "poll_interval" in str(caught.value)
    assert repr(value) in str(caught.value)


def test_no_time_out_is_none() -> None:
    assert check_timeout("timeout", None) is None


@pytest.mark.parametrize("value", [1e-9, 1, 3600.0])
def test_a_time_out_above_zero_passes(value: float) -> None:
    assert check_timeout("timeout", value) == value


@pytest.mark.parametrize("value", [0, 0.0, -1, NAN, INF], ids=repr)
def test_a_time_out_that_is_not_above_zero_is_a_value_error(value: float) -> None:
    with pytest.raises(ValueError, match="timeout must be None or seconds above 0") as caught:
        check_timeout("timeout", value)
    assert repr(value) in str(caught.value)


@pytest.mark.parametrize("value", ["1", True, False, Fraction(1, 2), Index(), [1]], ids=repr)
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
