"""What a status repeats of the request in force, and what an image would have it repeat."""

from __future__ import annotations

from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.values.enums import Mode
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of

POSITIONS = (10, 20, 30, 40)
IMAGE = Request(
    activate=True,
    go=True,
    release=True,
    mode=Mode.PINCH,
    axes=tuple(AxisRequest(position, 1, 5) for position in POSITIONS),
)


@given(st.tuples(*[st.integers(0, 0xFFFF)] * 8))
def test_what_a_status_echoes_is_what_its_properties_say(block: tuple[int, ...]) -> None:
    status = RobotiqStatus.from_registers(block)
    assert status.echo == (
        status.activation_echo,
        status.go_echo,
        *(status.requested_position(axis) for axis in THREE_FINGER.axes),
    )


@given(
    st.booleans(),
    st.booleans(),
    st.tuples(*[st.integers(0, 255)] * 4),
    st.integers(0, 5),
    st.integers(1, 255),
)
def test_a_status_echoes_an_image_only_if_go_activation_and_all_positions_agree(
    activate: bool, go: bool, positions: tuple[int, ...], which: int, by: int
) -> None:
    image = Request(
        activate=activate, go=go, axes=tuple(AxisRequest(position, 1, 2) for position in positions)
    )
    shown = [*positions, activate, go]
    assert status_of(0x30 | activate | go << 3, echo=positions).echo == image.echo
    shown[which] = not shown[which] if which > 3 else (shown[which] + by) % 256
    *others, act, goes = shown
    assert status_of(0x30 | act | goes << 3, echo=others).echo != image.echo


def test_mode_speed_and_force_have_no_part_in_the_echo() -> None:
    plain = Request(activate=True, axes=tuple(AxisRequest(position, 0, 0) for position in POSITIONS))
    assert IMAGE.echo == (True, True, 10, 20, 30, 40)
    assert plain.echo == (True, False, 10, 20, 30, 40)
    for mode in range(4):
        assert status_of(0x31 | mode << 1, echo=POSITIONS).echo == plain.echo
