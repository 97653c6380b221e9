"""RobotiqStatus against the words of the manual."""

from __future__ import annotations

import itertools
from collections.abc import Callable

import pytest
from hypothesis import given

from robotiq_async import Fault, Finger, Initialization, Mode, ObjectStatus, RobotiqStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.status import NO_REQUEST
from tests.register_words import bytes_of, registers_of, status_of
from tests.strategies import BLOCKS

AXES = A, B, C, S = THREE_FINGER.axes

PER_AXIS: list[Callable[[RobotiqStatus, Finger], object]] = [
    RobotiqStatus.finger_status,
    RobotiqStatus.axis_state,
    RobotiqStatus.position,
    RobotiqStatus.requested_position,
    RobotiqStatus.current,
    RobotiqStatus.current_ma,
]
MOVING, OPENING, CLOSING, THERE = ObjectStatus


# -- the words of the manual -------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("words", "axes", "moving", "contacts", "motion"),
    [
        ((0x39, 0xC0), (MOVING, MOVING, MOVING, THERE), Finger.ABC, Finger(0), 0),
        ((0xB9, 0xEA), (CLOSING, CLOSING, CLOSING, THERE), Finger(0), Finger.ABC, 2),
        ((0xB1, 0xEA), (CLOSING, CLOSING, CLOSING, THERE), Finger(0), Finger.ABC, 2),
        ((0xF9, 0xFF), (THERE,) * 4, Finger(0), Finger(0), 3),
        ((0x79, 0b11_00_10_01), (OPENING, CLOSING, MOVING, THERE), C, A | B, 1),
        ((0x31, 0x00), (MOVING,) * 4, Finger(0), Finger(0), 0),
    ],
    ids=["closing", "holding", "holding, rGTO cleared", "in place", "mixed", "never told to go"],
)
def test_motion_and_contacts(
    words: tuple[int, int], axes: tuple[ObjectStatus, ...], moving: Finger, contacts: Finger, motion: int
) -> None:
    status = status_of(*words)
    assert tuple(map(status.finger_status, AXES)) == axes
    assert (status.moving, status.contacts, status.motion) == (moving, contacts, motion)


@pytest.mark.parametrize(
    ("byte_0", "echo", "activated", "reset"),
    [(0x11, True, False, False), (0x31, True, True, False), (0x00, False, False, True)],
)
def test_activation(byte_0: int, echo: bool, activated: bool, reset: bool) -> None:
    status = status_of(byte_0)
    assert (status.activation_echo, status.is_activated, status.is_reset) == (echo, activated, reset)


def test_an_axis_moves_only_while_asked_to_go_and_fully_active() -> None:
    for initialization, go, what in itertools.product(range(4), range(2), range(4)):
        status = status_of(0x01 | go << 3 | initialization << 4, what | 0b11_11_11_00)
        moves = (initialization, go, what) == (3, 1, 0)
        assert status.is_moving == moves, (initialization, go, what)
        assert status.moving == (A if moves else Finger(0))


# -- every status ------------------------------------------------------------------------------------------


@given(BLOCKS)
def test_any_eight_registers_are_a_status_that_answers_everything(block: tuple[int, ...]) -> None:
    status = RobotiqStatus.from_registers(block)
    content = bytes_of(block)
    is_asked = status.go_echo and status.is_activated
    for number, axis in enumerate(AXES):
        assert status.requested_position(axis) == content[3 + 3 * number]
        assert status.position(axis) == content[4 + 3 * number]
        assert status.current(axis) == content[5 + 3 * number]
        assert status.current_ma(axis) == 10 * content[5 + 3 * number]
        reported = status.finger_status(axis)
        assert reported == content[1] >> 2 * number & 3
        assert status.axis_state(axis) == (reported.name if reported or is_asked else NO_REQUEST)
        assert (axis in status.moving) == (is_asked and reported is MOVING)
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
    assert status.echo == (
        status.activation_echo,
        status.go_echo,
        *(status.requested_position(axis) for axis in AXES),
    )


@given(BLOCKS, BLOCKS)
def test_equal_registers_make_equal_statuses_and_different_ones_different(
    one: tuple[int, ...], other: tuple[int, ...]
) -> None:
    first, second = RobotiqStatus.from_registers(one), RobotiqStatus.from_registers(other)
    assert (first == second) == (one == other)
    assert first == RobotiqStatus.from_registers(one)
    assert hash(first) == hash(RobotiqStatus.from_registers(one))


# -- a value object ----------------------------------------------------------------------------------------


def test_a_status_holds_its_registers_timestamp_and_sequence() -> None:
    block = registers_of(range(16))
    status = RobotiqStatus.from_registers(list(block), timestamp=12.5, sequence=7)
    assert (status.registers, status.timestamp, status.sequence) == (block, 12.5, 7)
    assert type(status.registers) is tuple
    plain = RobotiqStatus.from_registers([0] * 8)
    assert (plain.timestamp, plain.sequence) == (0.0, 0)


def test_statuses_of_different_polls_differ() -> None:
    status = status_of(0x31, at=1.0, sequence=1)
    assert status == status_of(0x31, at=1.0, sequence=1)
    assert status != status_of(0x31, at=2.0, sequence=1)
    assert status != status_of(0x31, at=1.0, sequence=2)
    assert status != status.registers


def test_a_status_cannot_be_changed_nor_made_anew_in_place() -> None:
    status = status_of(0x39, 0xC0, at=1.0, sequence=3)
    for name in ("registers", "timestamp", "sequence", "fault", "note", "_registers"):
        with pytest.raises(AttributeError):
            setattr(status, name, 1)
    with pytest.raises(AttributeError):
        RobotiqStatus.__init__(status, (0,) * 8)
    assert status == status_of(0x39, 0xC0, at=1.0, sequence=3)


def test_the_repr_shows_what_a_person_looks_for_first() -> None:
    words = (0xB9, 0xEA, 0x0C)
    text = repr(status_of(*words, echo=255, position=(151, 152, 153, 137), current=9, sequence=42))
    for part in ("#42", "COMPLETE", "go=1", "UNKNOWN_0x0C", "A=151->255 CONTACT_CLOSING 90mA", "SCISSOR=137"):
        assert part in text


# -- arguments ---------------------------------------------------------------------------------------------


@pytest.mark.parametrize("read", PER_AXIS)
def test_a_mask_of_several_axes_is_refused(read: Callable[[RobotiqStatus, object], object]) -> None:
    with pytest.raises(ValueError, match="finger must be one of"):
        read(status_of(0x31), Finger.ABC)
    with pytest.raises(TypeError, match="finger must be one Finger"):
        read(status_of(0x31), 1.0)


def test_an_axis_may_be_given_as_its_number() -> None:
    status = status_of(0x31, echo=(1, 2, 3, 4))
    assert [status.requested_position(axis) for axis in (1, 2, 4, 8)] == [1, 2, 3, 4]


@pytest.mark.parametrize(
    ("registers", "error"),
    [([0] * 7, ValueError), ([0x10000] + [0] * 7, ValueError), ([0.0] * 8, TypeError)],
)
def test_other_than_eight_registers_is_refused(registers: list[int], error: type[Exception]) -> None:
    with pytest.raises(error, match="registers"):
        RobotiqStatus.from_registers(registers)
