"""RobotiqStatus against the words of the manual."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async import Fault, Finger, Initialization, Mode, ObjectStatus, RobotiqStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.status import NO_REQUEST
from tests.register_words import bytes_of, registers_of, status_of

A, B, C, S = THREE_FINGER.axes
BLOCKS = st.tuples(*[st.integers(0, 0xFFFF)] * 8)

PER_AXIS: list[Callable[[RobotiqStatus, Finger], object]] = [
    RobotiqStatus.finger_status,
    RobotiqStatus.axis_state,
    RobotiqStatus.position,
    RobotiqStatus.requested_position,
    RobotiqStatus.current,
    RobotiqStatus.current_ma,
]


# -- the words of the manual -------------------------------------------------------------------------------


def test_an_activating_gripper_is_neither_active_nor_reset_nor_moving() -> None:
    status = status_of(0x11, 0x00)
    assert status.initialization is Initialization.ACTIVATING
    assert status.activation_echo
    assert not status.is_activated
    assert not status.is_reset
    assert not status.is_moving


def test_a_ready_gripper_that_was_never_told_to_go_does_not_move_although_every_motion_field_is_zero() -> (
    None
):
    status = status_of(0x31, 0x00)
    assert status.is_activated
    assert not status.go_echo
    assert status.motion == 0
    assert [status.finger_status(axis) for axis in THREE_FINGER.axes] == [ObjectStatus.IN_MOTION] * 4
    assert not status.is_moving
    assert status.moving == Finger(0)


@given(BLOCKS, st.sampled_from(THREE_FINGER.axes))
def test_an_axis_is_in_motion_exactly_when_it_moves(block: tuple[int, ...], axis: Finger) -> None:
    status = RobotiqStatus.from_registers(block)
    state, reported = status.axis_state(axis), status.finger_status(axis)
    assert (state == "IN_MOTION") == (axis in status.moving)
    if reported is not ObjectStatus.IN_MOTION:
        assert state == reported.name
    elif not (status.go_echo and status.is_activated):
        assert state == NO_REQUEST


def test_a_closing_gripper_moves_its_fingers_and_not_the_scissor() -> None:
    status = status_of(0x39, 0xC0)
    assert status.is_moving
    assert status.moving == Finger.ABC
    assert status.finger_status(S) is ObjectStatus.AT_POSITION
    assert status.contacts == Finger(0)


def test_a_held_object_is_a_contact_while_closing_of_all_three_fingers() -> None:
    status = status_of(0xB9, 0xEA)
    assert [status.finger_status(axis) for axis in (A, B, C)] == [ObjectStatus.CONTACT_CLOSING] * 3
    assert status.contacts == Finger.ABC
    assert not status.is_moving
    assert status.motion == 2


def test_a_reached_position_is_no_contact() -> None:
    status = status_of(0xF9, 0xFF)
    assert [status.finger_status(axis) for axis in THREE_FINGER.axes] == [ObjectStatus.AT_POSITION] * 4
    assert status.contacts == Finger(0)
    assert not status.is_moving
    assert status.motion == 3


def test_a_reset_gripper_is_reset() -> None:
    status = status_of(0x00, 0x00)
    assert status.is_reset
    assert not status.activation_echo
    assert not status.is_activated


def test_one_is_a_contact_while_opening_and_two_a_contact_while_closing() -> None:
    # A: 01, B: 10, C: 00, scissor: 11.
    status = status_of(0x79, 0b11_00_10_01)
    assert status.finger_status(A) is ObjectStatus.CONTACT_OPENING
    assert status.finger_status(B) is ObjectStatus.CONTACT_CLOSING
    assert status.finger_status(C) is ObjectStatus.IN_MOTION
    assert status.finger_status(S) is ObjectStatus.AT_POSITION
    assert status.contacts == A | B
    assert status.moving == C


def test_a_current_of_fifteen_counts_is_150_milliampere() -> None:
    status = status_of(0x39, current=(0x0F, 0, 1, 0xFF))
    assert [status.current(axis) for axis in THREE_FINGER.axes] == [15, 0, 1, 255]
    assert [status.current_ma(axis) for axis in THREE_FINGER.axes] == [150, 0, 10, 2550]


def test_an_axis_moves_only_while_told_to_go_and_fully_active() -> None:
    for initialization, go, what in itertools.product(range(4), range(2), range(4)):
        status = status_of(0x01 | go << 3 | initialization << 4, what | 0b11_11_11_00)
        moves = (initialization, go, what) == (3, 1, 0)
        assert status.is_moving == moves, (initialization, go, what)
        assert status.moving == (A if moves else Finger(0))


def test_a_contact_stays_visible_when_the_go_bit_is_cleared() -> None:
    assert status_of(0xB1, 0xEA).contacts == Finger.ABC


# -- every status ------------------------------------------------------------------------------------------


@given(BLOCKS)
def test_any_eight_registers_are_a_status_that_answers_everything(block: tuple[int, ...]) -> None:
    status = RobotiqStatus.from_registers(block)
    content = bytes_of(block)
    for number, axis in enumerate(THREE_FINGER.axes):
        assert status.requested_position(axis) == content[3 + 3 * number]
        assert status.position(axis) == content[4 + 3 * number]
        assert status.current(axis) == content[5 + 3 * number]
        assert status.current_ma(axis) == 10 * content[5 + 3 * number]
        assert status.finger_status(axis) == content[1] >> 2 * number & 3
    assert status.activation_echo == bool(content[0] & 1)
    assert status.mode is Mode(content[0] >> 1 & 3)
    assert status.go_echo == bool(content[0] & 8)
    assert status.initialization is Initialization(content[0] >> 4 & 3)
    assert status.motion == content[0] >> 6
    assert int(status.fault) == content[2] & 0x0F
    assert (status.fault is Fault.NONE) == (content[2] & 0x0F == 0)
    assert status.is_moving == bool(status.moving)
    assert not status.moving & status.contacts
    assert status.registers == block
    assert repr(status)


@given(BLOCKS, BLOCKS)
def test_equal_registers_make_equal_statuses_and_different_ones_different(
    one: tuple[int, ...], other: tuple[int, ...]
) -> None:
    first, second = RobotiqStatus.from_registers(one), RobotiqStatus.from_registers(other)
    assert (first == second) == (one == other)
    assert first == RobotiqStatus.from_registers(one)
    assert hash(first) == hash(RobotiqStatus.from_registers(one))


# -- a value object ----------------------------------------------------------------------------------------


def test_a_status_gives_its_registers_timestamp_and_sequence_back() -> None:
    block = registers_of(range(16))
    status = RobotiqStatus.from_registers(list(block), timestamp=12.5, sequence=7)
    assert status.registers == block
    assert type(status.registers) is tuple
    assert status.timestamp == 12.5
    assert status.sequence == 7


def test_without_a_timestamp_and_a_number_both_are_zero() -> None:
    status = RobotiqStatus.from_registers([0] * 8)
    assert (status.timestamp, status.sequence) == (0.0, 0)


def test_statuses_of_different_polls_differ() -> None:
    status = status_of(0x31, at=1.0, sequence=1)
    assert status == status_of(0x31, at=1.0, sequence=1)
    assert status != status_of(0x31, at=2.0, sequence=1)
    assert status != status_of(0x31, at=1.0, sequence=2)
    assert status != status.registers


@pytest.mark.parametrize(
    "name", ["registers", "timestamp", "sequence", "fault", "note", "_registers", "_sequence"]
)
def test_a_status_cannot_be_changed(name: str) -> None:
    status = status_of(0x39, 0xC0, at=1.0, sequence=3)
    with pytest.raises(AttributeError):
        setattr(status, name, 1)
    assert status == status_of(0x39, 0xC0, at=1.0, sequence=3)


def test_a_status_cannot_be_made_anew_in_place() -> None:
    status = status_of(0x39, 0xC0)
    with pytest.raises(AttributeError):
        RobotiqStatus.__init__(status, (0,) * 8)
    assert status == status_of(0x39, 0xC0)


def test_the_repr_tells_what_a_person_looks_for_first() -> None:
    text = repr(
        status_of(
            0xB9, 0xEA, 0x0C, echo=255, position=(151, 152, 153, 137), current=(9, 8, 7, 0), sequence=42
        )
    )
    for part in (
        "#42",
        "COMPLETE",
        "go=1",
        "UNKNOWN_0x0C",
        "A=151->255 CONTACT_CLOSING 90mA",
        "SCISSOR=137->255",
    ):
        assert part in text


# -- arguments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("read", PER_AXIS)
def test_what_is_not_one_axis_is_refused(read: Callable[[RobotiqStatus, object], object]) -> None:
    with pytest.raises(ValueError, match="finger must be one of"):
        read(status_of(0x31), Finger.ABC)
    with pytest.raises(TypeError, match="finger must be one Finger"):
        read(status_of(0x31), 1.0)


def test_an_axis_may_be_given_as_its_number() -> None:
    status = status_of(0x31, echo=(1, 2, 3, 4))
    assert [status.requested_position(axis) for axis in (1, 2, 4, 8)] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("registers", "error"),
    [([0] * 7, ValueError), ([0] * 9, ValueError), ([0x10000] + [0] * 7, ValueError), ([0.0] * 8, TypeError)],
    ids=["seven", "nine", "too large", "floats"],
)
def test_what_is_not_eight_registers_is_refused(registers: list[int], error: type[Exception]) -> None:
    with pytest.raises(error, match="registers"):
        RobotiqStatus.from_registers(registers)
