"""What is merged between two writes, and how each call ends."""

from __future__ import annotations

from collections.abc import Callable

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.requests.pending import Command, PendingCommand
from robotiq_async.values.enums import Finger
from robotiq_async.values.errors import ConnectionLostError, MoveSupersededError
from robotiq_async.values.model import THREE_FINGER
from tests.control.scan import Outcome

A, B, C, S = THREE_FINGER.axes
ABC, NONE = Finger.ABC, Finger(0)
SUPERSEDED = MoveSupersededError("halt")
LOST = ConnectionLostError("gone")


# -- merging -----------------------------------------------------------------------------------------------


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
    pending = PendingCommand()
    for axes, position, speed, force in commands:
        pending.merge(Command(axes, position, speed, force))
    for field, merged in enumerate((pending.positions, pending.speeds, pending.forces)):
        for axis in THREE_FINGER.axes:
            values = [
                values[field] for axes, *values in commands if axis in axes and values[field] is not None
            ]
            assert merged.get(axis) == (values[-1] if values else None)
    assert pending.is_empty == (not any(value is not None for _, *values in commands for value in values))


# -- holding and halting -----------------------------------------------------------------------------------

Step = Callable[[PendingCommand], None]


def command(axes: Finger, position: int | None = None, setting: int | None = None) -> Step:
    """With the same setting for speed and force."""
    return lambda pending: pending.merge(Command(axes, position, setting, setting))


def hold(axes: Finger) -> Step:
    return lambda pending: pending.merge_hold(axes, SUPERSEDED)


def halt(pending: PendingCommand) -> None:
    pending.merge_halt(Outcome(), SUPERSEDED)


@pytest.mark.parametrize(
    ("steps", "positions", "settings", "held", "moved"),
    [
        # A hold drops the unsent positions of its axes, a halt all of them; both keep speeds and forces.
        ([command(ABC, 100, 50), hold(A | B)], {C: 100}, {A: 50, B: 50, C: 50}, A | B, C),
        ([command(ABC, 100, 50), halt], {}, {A: 50, B: 50, C: 50}, NONE, NONE),
        # A new speed does not lift a hold, and only a position moves an axis.
        ([hold(A), command(A, None, 50)], {}, {A: 50}, A, NONE),
        ([command(A | S, 100), command(B, None, 50), hold(C)], {A: 100, S: 100}, {B: 50}, C, A | S),
        # A hold that a position or a halt goes before is remembered: if that is lost, the stop is not.
        ([hold(A), hold(B), command(A, 100)], {A: 100}, {}, A | B, A),
        ([hold(A), hold(B), command(A, 100), halt], {}, {}, A | B, NONE),
    ],
)
def test_holds_and_halts_drop_positions_and_nothing_else(
    steps: list[Step], positions: dict[Finger, int], settings: dict[Finger, int], held: Finger, moved: Finger
) -> None:
    pending = PendingCommand()
    for step in steps:
        step(pending)
    assert (pending.positions, pending.hold, pending.moved) == (positions, held, moved)
    assert pending.speeds == pending.forces == settings


def test_a_hold_fails_only_the_callers_that_move_its_axes() -> None:
    pending, held, other, setting = PendingCommand(), Outcome(), Outcome(), Outcome()
    pending.merge(Command(A, 100), held)
    pending.merge(Command(B, 100), other)
    pending.merge(Command(A, None, 50), setting)
    pending.merge_hold(A, SUPERSEDED)
    assert isinstance(held.error, MoveSupersededError)
    assert not other.answers
    assert not setting.answers


@pytest.mark.parametrize(
    ("fill", "empty", "holds_at_most"),
    [
        (lambda _: None, True, True),
        (hold(A), False, True),
        (command(A, 1), False, False),
        (lambda pending: pending.merge(Command(A, None, 1)), False, False),
        (lambda pending: pending.merge(Command(A, None, None, 1)), False, False),
        (halt, False, False),
    ],
    ids=["nothing", "hold", "position", "speed", "force", "halt"],
)
def test_a_pending_command_knows_whether_there_is_something_to_write(
    fill: Step, empty: bool, holds_at_most: bool
) -> None:
    pending = PendingCommand()
    fill(pending)
    assert pending.is_empty == empty
    assert pending.holds_at_most == holds_at_most


# -- who waits ---------------------------------------------------------------------------------------------


def test_a_halt_drops_positions_and_leaves_pending_speeds() -> None:
    """The speed stays on the pending and is delivered: its caller must not hear MoveSupersededError."""
    pending, for_speed, for_position = PendingCommand(), Outcome(), Outcome()
    pending.merge(Command(A, None, 50), for_speed)
    pending.merge(Command(B, 100), for_position)
    pending.merge_halt(Outcome(), SUPERSEDED)
    assert pending.speeds == {A: 50}
    assert isinstance(for_position.error, MoveSupersededError)
    assert not for_speed.answers
    assert pending.waiters == [for_speed]


def test_a_position_replaces_a_hold_and_its_caller_still_waits() -> None:
    pending, holder = PendingCommand(), Outcome()
    pending.merge_hold(A, SUPERSEDED, holder)
    pending.merge(Command(A, 100))
    assert pending.waiters == [holder]
    assert not holder.is_answered


def test_every_caller_of_halt_is_kept() -> None:
    pending, one, other = PendingCommand(), Outcome(), Outcome()
    pending.merge_halt(one, SUPERSEDED)
    pending.merge_halt(other, SUPERSEDED)
    assert pending.halting == [one, other]


# -- telling -----------------------------------------------------------------------------------------------


def test_a_failure_gives_every_caller_an_error_of_its_own() -> None:
    pending, callers, halter = PendingCommand(), [Outcome(), Outcome()], Outcome()
    pending.merge(Command(A, 100), callers[0])
    pending.merge(Command(A, None, 50), callers[1])
    pending.halting = [halter]
    pending.fail(LOST)
    errors = [each.answers[0] for each in (*callers, halter)]
    assert all(isinstance(error, ConnectionLostError) for error in errors)
    assert len({id(error) for error in errors}) == 3


def test_callers_of_halt_do_not_wait_for_the_acknowledgement_alone() -> None:
    """A halt ends when the gripper shows that it has stopped."""
    pending, callers = PendingCommand(), [Outcome(), Outcome()]
    pending.merge(Command(A, 100), callers[0])
    pending.merge(Command(A, None, 50), callers[1])
    pending.halting = [Outcome()]
    assert pending.waiters == callers
