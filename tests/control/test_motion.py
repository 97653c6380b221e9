"""Moves: their end, their result, their time limit, and those that run."""

from __future__ import annotations

import dataclasses

import pytest

from robotiq_async.control.entry import Entry
from robotiq_async.control.ledger import Ledger
from robotiq_async.control.pending import OpenRequests, Pending, changes
from robotiq_async.control.waiters import Move, fail
from robotiq_async.values.enums import NO_AXES, Finger, ObjectStatus
from robotiq_async.values.errors import MoveSupersededError
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.move_result import MoveResult
from robotiq_async.values.status import RobotiqStatus
from tests.control.scan import Ended, Outcome, first_request
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
ABC = Finger.ABC


def move(position: int = 255, axes: Finger = ABC, now: float = 10.0) -> tuple[Move, Outcome]:
    outcome = Outcome()
    return Move(position, axes, now, outcome), outcome


def ended(each: tuple[Move, Outcome], status: RobotiqStatus) -> MoveResult:
    """The result of a move that a status has ended."""
    move, outcome = each
    move.end(status)
    return outcome.result


# -- when it has ended -------------------------------------------------------------------------------------


UNDER = (255, 255, 255, 0)
"""The echo of a move of the fingers to 255."""


@pytest.mark.parametrize(
    ("axes", "byte_0", "byte_1", "echo", "is_under", "has_arrived"),
    [
        (ABC, 0xF9, 0xFF, UNDER, True, True),
        (ABC, 0xB9, 0xEA, UNDER, True, True),  # in contact
        (ABC, 0x39, 0b11_11_11_00, UNDER, True, False),
        (ABC, 0x39, 0b11_11_00_11, UNDER, True, False),
        (ABC, 0x39, 0b11_00_11_11, UNDER, True, False),
        (ABC, 0x39, 0b00_11_11_11, UNDER, True, True),  # an axis that is not addressed may move on
        (A | B, 0x39, 0b00_00_11_11, (255, 255, 0, 0), True, True),
        (ABC, 0xF9, 0xFF, (254, 255, 255, 0), False, False),
        (ABC, 0xF9, 0xFF, (255, 0, 255, 0), False, False),
        (ABC, 0xF9, 0xFF, (255, 255, 100, 0), False, False),
        (ABC, 0xF1, 0xFF, UNDER, False, False),  # halted
    ],
)
def test_a_move_has_arrived_when_every_addressed_axis_rests_under_its_request(
    axes: Finger, byte_0: int, byte_1: int, echo: tuple[int, ...], is_under: bool, has_arrived: bool
) -> None:
    """Wherever it rests: open stops at 6-7 for a request of 0, closed at 240 or above."""
    (each, _), status = move(255, axes), status_of(byte_0, byte_1, echo=echo, position=241)
    assert each.is_under(status, {}) is is_under
    assert each.see(status, NO_AXES, {}) is has_arrived
    assert not each.see(status, A, {}), "one is not known to rest"


# -- the outcome is handed over once -----------------------------------------------------------------------


def test_a_move_ends_once_with_the_first_outcome() -> None:
    each, outcome = move()
    moves = live(each)
    moves.supersede(A, "first")
    ENDED.answer()
    fail(moves.drop(holds=True), MoveSupersededError("second"))
    each.end(status_of(0xF9, 0xFF))
    assert [str(error) for error in outcome.answers] == ["first"]


def test_a_move_that_ended_well_does_not_fail_afterwards() -> None:
    each, outcome = move()
    moves = live(each)
    each.end(status_of(0xF9, 0xFF))
    fail(moves.drop(holds=True), MoveSupersededError("late"))
    assert outcome.result.status == status_of(0xF9, 0xFF)


def test_it_is_known_which_axes_still_follow_a_move() -> None:
    (each, _), (failed, _), (arrived, _) = move(), move(), move()
    assert live(each).leave(each) == (True, ABC)
    moves = live(failed)
    moves.supersede(A, "A")
    ENDED.answer()
    moves.command(changes(B, 0))
    assert moves.leave(failed) == (False, C)
    moves = live(arrived)
    write(moves)
    moves.end_arrived(ARRIVED, LEDGER)
    assert moves.leave(arrived) == (False, Finger(0))


# -- the result --------------------------------------------------------------------------------------------


def test_a_result_tells_of_each_addressed_axis_and_of_no_other() -> None:
    """A and B hold something, C is closed, the scissor touches something too."""
    each, outcome = move(255, ABC, now=10.0)
    each.see(status_of(0x39, 0xC0, echo=255, current=(15, 5, 0, 200)), Finger.ALL, {})
    each.see(status_of(0x39, 0xC0, echo=255, current=(3, 40, 1, 0)), Finger.ALL, {})
    last = status_of(
        0x79, 0b10_11_10_10, echo=255, position=(150, 151, 241, 99), current=(9, 9, 9, 9), at=12.5
    )
    each.see(last, Finger.ALL, {})
    result = ended((each, outcome), last)
    assert dict(result.outcomes) == {
        A: ObjectStatus.CONTACT_CLOSING,
        B: ObjectStatus.CONTACT_CLOSING,
        C: ObjectStatus.AT_POSITION,
    }
    assert dict(result.positions) == {A: 150, B: 151, C: 241}
    assert result.contacts == A | B
    assert result.object_detected
    assert dict(result.peak_current_ma) == {A: 150, B: 400, C: 90}
    assert (result.duration, result.status) == (2.5, last)


def test_a_contact_while_opening_is_an_object_too() -> None:
    result = ended(move(0, A), status_of(0x79, 0b11_11_11_01, echo=0))
    assert dict(result.outcomes) == {A: ObjectStatus.CONTACT_OPENING}
    assert result.contacts == A
    assert result.object_detected


def test_without_a_contact_nothing_was_detected() -> None:
    result = ended(move(255, A), status_of(0x79, 0b10_10_10_11, echo=255))
    assert result.contacts == Finger(0)
    assert not result.object_detected


def test_a_result_cannot_be_changed() -> None:
    result = ended(move(255, ABC), status_of(0xF9, 0xFF))
    with pytest.raises(dataclasses.FrozenInstanceError):
        result.contacts = ABC  # type: ignore[misc]
    for mapping in (result.outcomes, result.positions, result.peak_current_ma):
        with pytest.raises(TypeError):
            mapping[A] = 0  # type: ignore[index]


def test_a_result_does_not_change_with_what_is_seen_later() -> None:
    each, outcome = move(255, A)
    result = ended((each, outcome), status_of(0xF9, 0xFF))
    each.see(status_of(0xF9, 0xFF, current=255), Finger.ALL, {})
    assert dict(result.peak_current_ma) == {A: 0}


# -- the moves that run ------------------------------------------------------------------------------------

LEDGER = Ledger(first_request())
ENDED = Ended()
ENTRY = LEDGER.last
ARRIVED = status_of(0xF9, 0xFF, echo=255, current=7)
MOVING = status_of(0x39, 0x00, echo=255, current=9)


def live(*each: Move) -> OpenRequests:
    moves = OpenRequests(ended=ENDED.add)
    for move in each:
        ask(moves, move)
    return moves


def ask(moves: OpenRequests, move: Move) -> None:
    moves.command(changes(move.axes, move.position))
    moves.add(move)


def write(moves: OpenRequests, entry: Entry = ENTRY) -> None:
    moves.sending(entry, Pending())


def test_a_move_that_was_not_written_yet_does_not_end() -> None:
    """The axes may rest where a move before this one has brought them."""
    each, outcome = move()
    moves = live(each)
    moves.end_arrived(ARRIVED, LEDGER)
    assert not outcome.answers
    write(moves)
    moves.end_arrived(ARRIVED, LEDGER)
    assert outcome.result.positions == {A: 0, B: 0, C: 0}
    assert not moves.moves


def test_a_move_whose_write_does_not_act_yet_does_not_end() -> None:
    each, outcome = move()
    moves = live(each)
    ledger = Ledger(first_request())
    write(moves, ledger.write(ledger.base, A, 1.0))
    moves.end_arrived(ARRIVED, ledger)
    assert not outcome.answers
    ledger.acknowledge(1.0)
    moves.end_arrived(ARRIVED, ledger)
    assert outcome.is_answered


def test_a_move_takes_in_currents_from_its_write_on() -> None:
    each, outcome = move()
    moves = live(each)
    moves.end_arrived(status_of(0x39, 0x00, echo=255, current=99), LEDGER)
    write(moves)
    moves.end_arrived(MOVING, LEDGER)
    moves.end_arrived(ARRIVED, LEDGER)
    assert set(outcome.result.peak_current_ma.values()) == {90}


def test_a_later_write_does_not_carry_an_earlier_move() -> None:
    (first, _), (second, _), later = move(axes=A), move(axes=B), Ledger(first_request()).last
    moves = live(first)
    write(moves)
    ask(moves, second)
    write(moves, later)
    assert (first.entry, second.entry) == (ENTRY, later)


def test_every_move_that_has_arrived_ends_and_the_others_go_on() -> None:
    (first, one), (second, other), (third, goes_on) = move(axes=A), move(axes=B), move(100, C)
    moves = live(first, second, third)
    write(moves)
    moves.end_arrived(ARRIVED, LEDGER)
    assert one.is_answered
    assert other.is_answered
    assert not goes_on.answers
    assert moves.moves == [third]


def test_an_error_fails_its_moves_and_the_others_go_on() -> None:
    (first, one), (second, other) = move(axes=A), move(axes=B)
    moves = live(first, second)
    moves.supersede(A, "A")
    ENDED.answer()
    assert isinstance(one.error, MoveSupersededError)
    assert not other.answers
    fail(moves.drop(holds=False), error := MoveSupersededError("all"))
    assert isinstance(other.error, MoveSupersededError)
    assert other.error is not error, "each caller has one of its own"
    assert not moves.moves


def test_a_move_leaves_once() -> None:
    each, outcome = move()
    moves = live(each)
    assert moves.leave(each) == (True, ABC)
    assert moves.leave(each) == (False, Finger(0))
    fail(moves.drop(holds=True), MoveSupersededError("too late"))
    assert not outcome.answers


@pytest.mark.parametrize("how", ["end", "fail"])
def test_a_move_has_left_when_its_outcome_is_handed_over(how: str) -> None:
    was_under_way: list[bool] = []

    class Caller(Outcome):
        def set_result(self, result: object) -> None:
            was_under_way.append(moves.leave(each)[0])
            super().set_result(result)

        set_exception = set_result

    each = Move(255, ABC, 0.0, Caller())
    moves = live(each)
    write(moves)
    if how == "end":
        moves.end_arrived(ARRIVED, LEDGER)
    else:
        fail(moves.drop(holds=True), MoveSupersededError("now"))
    assert was_under_way == [False]
