"""Request images against the words of the manual."""

from __future__ import annotations

import dataclasses

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.values.enums import Finger, Mode
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from tests.register_words import REQUEST_RESERVED, bytes_of, registers_of

BYTES = st.integers(0, 255)
AXIS_REQUESTS = st.builds(AxisRequest, BYTES, BYTES, BYTES)
REQUESTS = st.builds(
    Request,
    activate=st.booleans(),
    go=st.booleans(),
    release=st.booleans(),
    mode=st.sampled_from(Mode),
    individual_fingers=st.booleans(),
    individual_scissor=st.booleans(),
    axes=st.tuples(*[AXIS_REQUESTS] * 4),
)
BLOCKS = st.tuples(*[st.integers(0, 0xFFFF)] * 8)

BITS = {
    "activate": (0, 0x01),
    "mode": (0, 0x06),
    "go": (0, 0x08),
    "release": (0, 0x10),
    "individual_fingers": (1, 0x04),
    "individual_scissor": (1, 0x08),
}
"""Byte and mask of each field of the whole hand, after the manual."""


# -- the words of the manual -------------------------------------------------------------------------------


def test_activation_alone_is_0x0100() -> None:
    request = Request(activate=True, individual_fingers=False, individual_scissor=False)
    assert request.registers == (0x0100, 0, 0, 0, 0, 0, 0, 0)


def test_everything_at_zero_resets() -> None:
    assert Request(individual_fingers=False, individual_scissor=False).registers == (0,) * 8


def test_every_axis_has_its_own_registers_unless_said_otherwise() -> None:
    assert Request().registers == (0x000C, 0, 0, 0, 0, 0, 0, 0)


def test_a_full_image_carries_position_speed_and_force_of_each_axis_in_this_order() -> None:
    request = Request(
        activate=True,
        go=True,
        axes=(
            AxisRequest(0x11, 0x12, 0x13),
            AxisRequest(0x21, 0x22, 0x23),
            AxisRequest(0x31, 0x32, 0x33),
            AxisRequest(0x41, 0x42, 0x43),
        ),
    )
    assert request.registers == (0x090C, 0x0011, 0x1213, 0x2122, 0x2331, 0x3233, 0x4142, 0x4300)


def test_an_automatic_release_is_bit_four_of_the_first_byte() -> None:
    request = Request(activate=True, release=True, individual_fingers=False, individual_scissor=False)
    assert request.registers[0] == 0x1100


# -- every request -----------------------------------------------------------------------------------------


@given(REQUESTS)
def test_an_image_that_is_read_back_is_the_same(request_: Request) -> None:
    again = Request.from_registers(request_.registers)
    assert again == request_
    assert type(again.mode) is Mode


@given(REQUESTS)
def test_reserved_bits_are_zero(request_: Request) -> None:
    content = bytes_of(request_.registers)
    assert len(content) == 16
    assert [byte & mask for byte, mask in zip(content, REQUEST_RESERVED, strict=True)] == [0] * 16


@given(BLOCKS)
def test_any_eight_registers_can_be_read_and_only_their_reserved_bits_are_lost(
    block: tuple[int, ...],
) -> None:
    kept = [byte & ~mask for byte, mask in zip(bytes_of(block), REQUEST_RESERVED, strict=True)]
    assert Request.from_registers(block).registers == registers_of(kept)


@given(REQUESTS, st.sampled_from(sorted(BITS)), st.data())
def test_a_field_of_the_whole_hand_changes_its_own_bits_only(
    before: Request, name: str, data: st.DataObject
) -> None:
    value = data.draw(st.sampled_from(Mode) if name == "mode" else st.booleans())
    after = dataclasses.replace(before, **{name: value})
    byte, mask = BITS[name]
    for index, (old, new) in enumerate(
        zip(bytes_of(before.registers), bytes_of(after.registers), strict=True)
    ):
        assert (old ^ new) & (0xFF ^ mask if index == byte else 0xFF) == 0
    shift = (mask & -mask).bit_length() - 1
    assert (bytes_of(after.registers)[byte] & mask) >> shift == int(value)


@given(REQUESTS, st.integers(0, 3), st.sampled_from(["position", "speed", "force"]), BYTES)
def test_a_field_of_one_axis_changes_its_own_byte_only(
    before: Request, number: int, name: str, value: int
) -> None:
    axes = list(before.axes)
    axes[number] = dataclasses.replace(axes[number], **{name: value})
    after = dataclasses.replace(before, axes=tuple(axes))
    expected = bytes_of(before.registers)
    expected[3 + 3 * number + ["position", "speed", "force"].index(name)] = value
    assert bytes_of(after.registers) == expected


@pytest.mark.parametrize(("name", "value"), [("position", -1), ("speed", 256), ("force", -1)])
def test_what_does_not_fit_into_a_byte_is_never_encoded(name: str, value: int) -> None:
    axis = dataclasses.replace(AxisRequest(), **{name: value})
    with pytest.raises(ValueError, match=f"value {value} does not fit"):
        _ = Request(axes=(AxisRequest(), axis, AxisRequest(), AxisRequest())).registers


@pytest.mark.parametrize("registers", [[0] * 7, [0] * 9, [-1] + [0] * 7], ids=["seven", "nine", "negative"])
def test_what_is_not_eight_registers_is_refused(registers: list[int]) -> None:
    with pytest.raises(ValueError, match="registers"):
        Request.from_registers(registers)


# -- positions ---------------------------------------------------------------------------------------------


@given(REQUESTS, st.dictionaries(st.sampled_from(THREE_FINGER.axes), BYTES))
def test_new_positions_change_the_positions_of_their_axes_and_nothing_else(
    before: Request, positions: dict[Finger, int]
) -> None:
    after = before.with_positions(positions)
    expected = bytes_of(before.registers)
    for axis, position in positions.items():
        expected[3 + 3 * THREE_FINGER.axes.index(axis)] = position
        assert after.position(axis) == position
    assert bytes_of(after.registers) == expected
