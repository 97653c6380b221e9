"""Requests merged between two writes, and the end of each call."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.ledger import Ledger
from robotiq_async.control.pending import NONE_PENDING, OpenRequests, Pending, changes
from robotiq_async.control.waiters import Move, fail
from robotiq_async.values.enums import Finger
from robotiq_async.values.errors import ConnectionLostError, MoveSupersededError
from robotiq_async.values.model import THREE_FINGER
from tests.control.scan import Ended, Outcome, first_request

A, B, C, S = THREE_FINGER.axes
ABC, NONE = Finger.ABC, Finger(0)
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
    pending = Pending()
    for axes, position, speed, force in commands:
        pending = pending.merged(changes(axes, position, speed, force))
    for field, merged in enumerate((pending.positions, pending.speeds, pending.forces)):
        for axis in THREE_FINGER.axes:
            values = [
                values[field] for axes, *values in commands if axis in axes and values[field] is not None
            ]
            assert merged.get(axis) == (values[-1] if values else None)
    assert pending.has_changes == any(value is not None for _, *values in commands for value in values)


# -- holding and halting -----------------------------------------------------------------------------------

Step = Callable[[OpenRequests], None]


def command(axes: Finger, position: int | None = None, setting: int | None = None) -> Step:
    """A command with the same setting for speed and force."""
    return lambda requests: requests.command(changes(axes, position, setting, setting))


def hold(axes: Finger) -> Step:
    return lambda requests: requests.hold(axes, "hold")


def halt(requests: OpenRequests) -> None:
    requests.supersede(Finger.ALL, "halt")


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
    requests = OpenRequests()
    for step in steps:
        step(requests)
    pending = requests.pending
    assert (pending.positions, pending.hold, pending.moved) == (positions, held, moved)
    assert pending.speeds == pending.forces == settings


def test_a_hold_fails_only_the_callers_that_move_its_axes() -> None:
    ended = Ended()
    requests, held, other, setting = OpenRequests(ended=ended.add), Outcome(), Outcome(), Outcome()
    requests.command(changes(A, 100), held)
    requests.command(changes(B, 100), other)
    requests.command(changes(A, None, 50), setting)
    hold(A)(requests)
    assert not held.answers, "they hear after the write"
    ended.answer()
    assert isinstance(held.error, MoveSupersededError)
    assert not other.answers
    assert not setting.answers


@pytest.mark.parametrize(
    ("fill", "empty", "has_changes"),
    [
        (lambda _: None, True, False),
        (hold(A), False, False),
        (command(A, 1), False, True),
        (lambda requests: requests.command(changes(A, None, 1)), False, True),
        (lambda requests: requests.command(changes(A, None, None, 1)), False, True),
    ],
    ids=["nothing", "hold", "position", "speed", "force"],
)
def test_a_pending_command_knows_whether_there_is_something_to_write(
    fill: Step, empty: bool, has_changes: bool
) -> None:
    requests = OpenRequests()
    fill(requests)
    assert (requests.pending is NONE_PENDING) == empty
    assert requests.pending.has_changes == has_changes


# -- who waits ---------------------------------------------------------------------------------------------


def waiting(requests: OpenRequests) -> list[object]:
    return [call.waiter for call in (*requests.calls, *requests.moves)]


def test_a_halt_drops_positions_and_leaves_pending_speeds() -> None:
    """The speed stays pending and is delivered: its caller must not hear MoveSupersededError."""
    requests, for_speed, for_position = OpenRequests(), Outcome(), Outcome()
    requests.command(changes(A, None, 50), for_speed)
    requests.command(changes(B, 100), for_position)
    halt(requests)
    assert requests.pending.speeds == {A: 50}
    assert isinstance(for_position.error, MoveSupersededError)
    assert not for_speed.answers
    assert waiting(requests) == [for_speed]


def test_a_position_goes_before_a_hold_whose_caller_still_waits() -> None:
    requests, holder = OpenRequests(), Outcome()
    requests.hold(A, "hold", holder)
    requests.command(changes(A, 100))
    assert waiting(requests) == [holder]
    assert not holder.is_answered


def test_a_hold_that_nobody_asked_for_is_no_request() -> None:
    requests = OpenRequests()
    requests.hold(A, "hold")
    assert not requests.has_caller
    requests.hold(B, "hold", Outcome())
    assert requests.has_caller
    requests.hold_only(C)
    assert requests.pending.hold == B, "another client moves A now; B was named by a caller"


def test_moves_that_end_together_are_answered_in_the_order_of_their_calls() -> None:
    requests, answered = OpenRequests(), list[Outcome]()

    class Noted(Outcome):
        def set_exception(self, error: object) -> None:
            answered.append(self)
            super().set_result(error)

    callers = [Noted(), Noted(), Noted()]
    for axes, caller in zip((C, A, B), callers, strict=True):
        requests.command(changes(axes, 100))
        requests.add(Move(100, axes, 0.0, caller))
    hold(Finger.ALL)(requests)
    assert answered == callers


def test_what_moves_is_dropped_alone_or_with_the_holds() -> None:
    requests, mover, holder = OpenRequests(), Outcome(), Outcome()
    requests.command(changes(A, 100, 50), mover)
    requests.hold(B, "hold", holder)
    requests.hold(C, "hold")
    fail(requests.drop(holds=False), LOST)
    assert isinstance(mover.error, ConnectionLostError)
    assert (requests.pending, holder.is_answered) == (Pending(hold=B), False)
    fail(requests.drop(holds=True), LOST)
    assert isinstance(holder.error, ConnectionLostError)
    assert requests.pending is NONE_PENDING


def test_a_halt_takes_the_holds_with_it() -> None:
    """The hold alone would leave nothing to write, and its caller would wait for ever."""
    requests, setter, holder = OpenRequests(), Outcome(), Outcome()
    requests.command(changes(B, None, 50), setter)
    requests.hold(A, "hold", holder)
    requests.sending(Ledger(first_request()).last, replace(requests.pending, hold=NONE))
    assert requests.pending == Pending(speeds={B: 50})
    requests.acknowledged()
    assert (holder.answers, waiting(requests)) == ([None], [setter])


def test_a_write_of_a_stop_or_a_procedure_takes_nothing_with_it() -> None:
    requests, setter, holder = OpenRequests(), Outcome(), Outcome()
    requests.command(changes(B, None, 50), setter)
    requests.hold(A, "hold", holder)
    requests.sending(Ledger(first_request()).last, requests.pending)
    requests.acknowledged()
    assert requests.pending == Pending(speeds={B: 50}, hold=A)
    assert waiting(requests) == [setter, holder]


def test_a_failure_gives_every_caller_an_error_of_its_own() -> None:
    requests, callers = OpenRequests(), [Outcome(), Outcome()]
    requests.command(changes(A, 100), callers[0])
    requests.command(changes(A, None, 50), callers[1])
    fail(requests.drop(holds=True), LOST)
    errors = [each.answers[0] for each in callers]
    assert all(isinstance(error, ConnectionLostError) for error in errors)
    assert len({id(error) for error in errors}) == 2
