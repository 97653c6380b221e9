"""Request images against the words of the manual."""

from __future__ import annotations

import dataclasses
from typing import Any

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.values.enums import Finger, Mode
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from tests.register_words import REQUEST_RESERVED, bytes_of, registers_of, status_of
from tests.strategies import BLOCKS, REQUESTS

BYTES = st.integers(0, 255)


def test_the_words_of_the_manual() -> None:
    plain: dict[str, Any] = {"individual_fingers": False, "individual_scissor": False}
    assert Request(**plain).registers == (0,) * 8
    assert Request(activate=True, **plain).registers == (0x0100, *(0,) * 7)
    assert Request(activate=True, release=True, **plain).registers == (0x1100, *(0,) * 7)
    assert Request().registers == (0x000C, *(0,) * 7), "every axis has its own registers"
    axes = tuple(AxisRequest(n + 1, n + 2, n + 3) for n in (0x10, 0x20, 0x30, 0x40))
    words = (0x090C, 0x0011, 0x1213, 0x2122, 0x2331, 0x3233, 0x4142, 0x4300)
    assert Request(activate=True, go=True, axes=axes).registers == words


@given(REQUESTS)
def test_every_field_has_its_bits_and_is_read_back(request_: Request) -> None:
    """The bytes are put together here as in the manual; the reserved ones are 0."""
    hand = request_.activate | request_.mode << 1 | request_.go << 3 | request_.release << 4
    individual = request_.individual_fingers << 2 | request_.individual_scissor << 3
    axes = [byte for axis in request_.axes for byte in (axis.position, axis.speed, axis.force)]
    assert bytes_of(request_.registers) == [hand, individual, 0, *axes, 0]
    again = Request.from_registers(request_.registers)
    assert again == request_
    assert type(again.mode) is Mode


@given(BLOCKS)
def test_any_eight_registers_can_be_read_and_only_their_reserved_bits_are_lost(
    block: tuple[int, ...],
) -> None:
    kept = [byte & ~mask for byte, mask in zip(bytes_of(block), REQUEST_RESERVED, strict=True)]
    assert Request.from_registers(block).registers == registers_of(kept)


@pytest.mark.parametrize(("name", "value"), [("position", -1), ("speed", 256), ("force", -1)])
def test_a_value_beyond_a_byte_is_never_encoded(name: str, value: int) -> None:
    axis = dataclasses.replace(AxisRequest(), **{name: value})
    with pytest.raises(ValueError, match=f"value {value} does not fit"):
        _ = Request(axes=(AxisRequest(), axis, AxisRequest(), AxisRequest())).registers


def test_other_than_eight_registers_is_refused() -> None:
    with pytest.raises(ValueError, match="registers"):
        Request.from_registers([0] * 7)


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


@given(REQUESTS, st.integers(0, 5), st.integers(1, 255))
def test_a_status_echoes_an_image_only_if_go_activation_and_all_positions_agree(
    image: Request, which: int, by: int
) -> None:
    """Mode, speed and force have no part in it."""
    positions = [axis.position for axis in image.axes]
    first = 0x30 | image.mode << 1
    assert status_of(first | image.activate | image.go << 3, echo=positions).echo == image.echo
    shown = [*positions, image.activate, image.go]
    shown[which] = not shown[which] if which > 3 else (shown[which] + by) % 256
    *others, act, goes = shown
    assert status_of(first | act | goes << 3, echo=others).echo != image.echo
