"""The moves under way: each leaves once, when it has arrived, when it fails, or when nobody waits for it."""

from __future__ import annotations

import pytest

from robotiq_async.control.motion import LiveMoves, Move
from robotiq_async.values.enums import Finger
from robotiq_async.values.errors import MoveSupersededError
from robotiq_async.values.model import THREE_FINGER
from tests.control.outcome import Outcome
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
ABC = Finger.ABC

ARRIVED = status_of(0xF9, 0xFF, echo=255, current=7)
MOVING = status_of(0x39, 0x00, echo=255, current=9)


def move(position: int = 255, axes: Finger = ABC, now: float = 10.0) -> tuple[Move, Outcome]:
    outcome = Outcome()
    return Move(position, axes, now, outcome), outcome


def acts(_: int) -> bool:
    return True


def live(*each: Move) -> LiveMoves:
    moves = LiveMoves()
    for move in each:
        moves.add(move)
    return moves


def test_a_move_that_was_not_written_yet_does_not_end() -> None:
    """The axes may rest where a move before this one has brought them."""
    each, outcome = move()
    moves = live(each)
    moves.see(ARRIVED, acts, Finger.ALL, {})
    assert not outcome.told
    moves.written(1)
    moves.see(ARRIVED, acts, Finger.ALL, {})
    assert outcome.result.positions == {A: 0, B: 0, C: 0}
    assert not moves


def test_a_move_whose_write_does_not_act_yet_does_not_end() -> None:
    each, outcome = move()
    moves = live(each)
    moves.written(7)
    moves.see(ARRIVED, lambda number: number < 7, Finger.ALL, {})
    assert not outcome.told
    moves.see(ARRIVED, lambda number: number <= 7, Finger.ALL, {})
    assert outcome.is_told


def test_a_move_takes_in_currents_from_its_write_on() -> None:
    each, outcome = move()
    moves = live(each)
    moves.see(status_of(0x39, 0x00, echo=255, current=99), acts, Finger.ALL, {})
    moves.written(1)
    moves.see(MOVING, acts, Finger.ALL, {})
    moves.see(ARRIVED, acts, Finger.ALL, {})
    assert set(outcome.result.peak_current_ma.values()) == {90}


def test_what_is_written_later_is_not_what_carried_an_earlier_move() -> None:
    (first, _), (second, _) = move(axes=A), move(axes=B)
    moves = live(first)
    moves.written(1)
    moves.add(second)
    moves.written(2)
    assert (first.write, second.write) == (1, 2)


def test_every_move_that_has_arrived_ends_and_the_others_go_on() -> None:
    (first, one), (second, other), (third, goes_on) = move(axes=A), move(axes=B), move(100, C)
    moves = live(first, second, third)
    moves.written(1)
    moves.see(ARRIVED, acts, Finger.ALL, {})
    assert one.is_told
    assert other.is_told
    assert not goes_on.told
    assert moves


def test_those_that_an_error_is_for_fail_and_the_others_go_on() -> None:
    (first, one), (second, other) = move(axes=A), move(axes=B)
    moves = live(first, second)
    moves.fail(MoveSupersededError("A"), lambda move: move.axes is A)
    assert isinstance(one.error, MoveSupersededError)
    assert not other.told
    moves.fail(MoveSupersededError("all"))
    assert isinstance(other.error, MoveSupersededError)
    assert not moves


def test_a_move_leaves_once() -> None:
    each, outcome = move()
    moves = live(each)
    assert moves.remove(each)
    assert not moves.remove(each)
    moves.fail(MoveSupersededError("too late"))
    assert not outcome.told


@pytest.mark.parametrize("how", ["end", "fail"])
def test_a_move_has_left_when_its_outcome_is_handed_over(how: str) -> None:
    was_under_way: list[bool] = []

    class Caller(Outcome):
        def set_result(self, result: object) -> None:
            was_under_way.append(moves.remove(each))
            super().set_result(result)

        set_exception = set_result

    each = Move(255, ABC, 0.0, Caller())
    moves = live(each)
    moves.written(1)
    if how == "end":
        moves.see(ARRIVED, acts, Finger.ALL, {})
    else:
        moves.fail(MoveSupersededError("now"))
    assert was_under_way == [False]
