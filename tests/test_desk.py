"""What is merged between two writes, and who is told what."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.pending import Desk, tell
from robotiq_async.enums import AXES, Finger
from robotiq_async.errors import ConnectionLostError, MoveSupersededError, RobotiqError

A, B, C, S = AXES
ABC, ALL = Finger.ABC, Finger.ALL


class Caller:
    """Somebody who waits for a write; told twice is a failure."""

    def __init__(self) -> None:
        self.told: list[RobotiqError | None] = []

    def __call__(self, outcome: RobotiqError | None) -> None:
        self.told.append(outcome)
        assert len(self.told) == 1, "told twice"


def superseded() -> RobotiqError:
    return MoveSupersededError("halt")


def lost() -> RobotiqError:
    return ConnectionLostError("gone")


# -- merging -----------------------------------------------------------------------------------------------


def test_a_new_desk_has_nothing_to_write() -> None:
    desk = Desk()
    assert desk.is_empty
    assert not desk.positions
    assert not desk.speeds
    assert not desk.forces
    assert desk.halt is None


def test_a_command_reaches_each_of_its_axes_and_no_other() -> None:
    desk = Desk()
    desk.put(A | S, 10, 20, 30)
    assert desk.positions == {A: 10, S: 10}
    assert desk.speeds == {A: 20, S: 20}
    assert desk.forces == {A: 30, S: 30}


def test_what_is_not_asked_is_not_changed() -> None:
    desk = Desk()
    desk.put(ABC, None, 20, None)
    assert not desk.positions
    assert desk.speeds == {A: 20, B: 20, C: 20}
    assert not desk.forces


def test_zero_is_something_to_ask_for() -> None:
    desk = Desk()
    desk.put(A, 0, 0, 0)
    assert (desk.positions, desk.speeds, desk.forces) == ({A: 0}, {A: 0}, {A: 0})
    assert not desk.is_empty


def test_the_last_value_wins_axis_by_axis() -> None:
    desk = Desk()
    desk.put(ABC, 10, 1, None)
    desk.put(B, 20, None, 2)
    desk.put(B | C, 30, None, None)
    assert desk.positions == {A: 10, B: 30, C: 30}
    assert desk.speeds == {A: 1, B: 1, C: 1}
    assert desk.forces == {B: 2}


@given(
    st.lists(
        st.tuples(
            st.integers(1, 15).map(Finger),
            *[st.none() | st.integers(0, 255)] * 3,
        ),
        max_size=8,
    )
)
def test_any_commands_leave_the_last_value_of_each_axis_and_field(
    commands: list[tuple[Finger, int | None, int | None, int | None]],
) -> None:
    desk = Desk()
    for axes, position, speed, force in commands:
        desk.put(axes, position, speed, force)
    for field, merged in enumerate((desk.positions, desk.speeds, desk.forces)):
        for axis in AXES:
            values = [
                values[field] for axes, *values in commands if axis in axes and values[field] is not None
            ]
            assert merged.get(axis) == (values[-1] if values else None)
    assert desk.is_empty == (not any(value is not None for _, *values in commands for value in values))


# -- holding -----------------------------------------------------------------------------------------------


def test_holding_an_axis_drops_its_unsent_position_and_no_other() -> None:
    desk = Desk()
    desk.put(ABC, 100, 50, 60)
    desk.put_hold(A | B, superseded)
    assert desk.positions == {C: 100}
    assert desk.speeds == {A: 50, B: 50, C: 50}
    assert desk.forces == {A: 60, B: 60, C: 60}
    assert desk.hold == A | B


def test_a_new_position_lifts_the_hold_of_its_axes_and_no_other() -> None:
    desk = Desk()
    desk.put_hold(ALL, superseded)
    desk.put(A, 100, None, None)
    assert desk.hold == B | C | S


def test_a_new_speed_does_not_lift_a_hold() -> None:
    desk = Desk()
    desk.put_hold(A, superseded)
    desk.put(A, None, 50, 60)
    assert desk.hold == A


def test_holds_add_up() -> None:
    desk = Desk()
    desk.put_hold(A, superseded)
    desk.put_hold(B, superseded)
    assert desk.hold == A | B


@pytest.mark.parametrize(
    ("fill", "empty", "only_holds"),
    [
        (lambda _: None, True, True),
        (lambda desk: desk.put_hold(A, superseded), False, True),
        (lambda desk: desk.put(A, 1, None, None), False, False),
        (lambda desk: desk.put(A, None, 1, None), False, False),
        (lambda desk: desk.put(A, None, None, 1), False, False),
        (lambda desk: desk.put_halt(Caller(), superseded), False, False),
    ],
    ids=["nothing", "hold", "position", "speed", "force", "halt"],
)
def test_a_desk_knows_whether_there_is_something_to_write(
    fill: Callable[[Desk], None], empty: bool, only_holds: bool
) -> None:
    desk = Desk()
    fill(desk)
    assert desk.is_empty == empty
    assert desk.only_holds == only_holds


# -- halting -----------------------------------------------------------------------------------------------


def test_a_halt_drops_unsent_positions_and_holds_and_keeps_speeds_and_forces() -> None:
    desk, halter = Desk(), Caller()
    desk.put(ABC, 100, 50, 60)
    desk.put_hold(S, superseded)
    desk.put_halt(halter, superseded)
    assert not desk.positions
    assert desk.hold == Finger(0)
    assert desk.speeds == {A: 50, B: 50, C: 50}
    assert desk.forces == {A: 60, B: 60, C: 60}
    assert desk.halt == [halter]
    assert not halter.told


def test_who_waits_for_a_position_is_told_that_a_halt_took_over() -> None:
    desk, caller = Desk(), Caller()
    desk.put(A, 100, None, None, caller)
    desk.put_halt(Caller(), superseded)
    assert isinstance(caller.told[0], MoveSupersededError)
    assert not desk.going


def test_who_waits_for_a_speed_goes_on_waiting_through_a_halt() -> None:
    desk, caller = Desk(), Caller()
    desk.put(A, None, 50, None, caller)
    desk.put_halt(Caller(), superseded)
    assert not caller.told
    assert desk.setting == [caller]


def test_who_waits_for_a_speed_goes_on_waiting_though_a_halt_drops_the_position_of_another() -> None:
    """The speed stays on the desk and is delivered: its caller must not hear MoveSupersededError."""
    desk, for_speed, for_position = Desk(), Caller(), Caller()
    desk.put(A, None, 50, None, for_speed)
    desk.put(B, 100, None, None, for_position)
    desk.put_halt(Caller(), superseded)
    assert desk.speeds == {A: 50}
    assert isinstance(for_position.told[0], MoveSupersededError)
    assert not for_speed.told


def test_every_caller_of_halt_is_kept() -> None:
    desk, one, other = Desk(), Caller(), Caller()
    desk.put_halt(one, superseded)
    desk.put_halt(other, superseded)
    assert desk.halt == [one, other]


def test_what_is_asked_after_a_halt_stays_on_the_desk() -> None:
    desk = Desk()
    desk.put_halt(Caller(), superseded)
    desk.put(A, 100, None, None)
    assert desk.positions == {A: 100}
    assert desk.halt is not None


# -- telling -----------------------------------------------------------------------------------------------


def test_everybody_who_waits_is_told_of_a_failure_with_an_error_of_their_own() -> None:
    desk, callers, halter = Desk(), [Caller(), Caller()], Caller()
    desk.put(A, 100, None, None, callers[0])
    desk.put(A, None, 50, None, callers[1])
    desk.halt = [halter]
    desk.fail(lost)
    errors = [each.told[0] for each in (*callers, halter)]
    assert all(isinstance(error, ConnectionLostError) for error in errors)
    assert len({id(error) for error in errors}) == 3


def test_a_desk_nobody_waits_at_fails_quietly() -> None:
    Desk().fail(lost)


def test_an_acknowledgement_is_told_as_none() -> None:
    callers = [Caller(), Caller()]
    tell(callers)
    assert [caller.told for caller in callers] == [[None], [None]]


def test_desks_share_nothing() -> None:
    one, other = Desk(), Desk()
    one.put(ALL, 1, 2, 3, Caller())
    one.put(ALL, None, 2, 3, Caller())
    one.halt = [Caller()]
    assert other.is_empty
    assert other.going == other.setting == []
