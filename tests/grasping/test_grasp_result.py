"""Who holds a part, from how a closing ended."""

from __future__ import annotations

import pytest

from robotiq_async import Finger, GraspResult, MoveResult, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
_, OPENING, CLOSING, REACHED = ObjectStatus


def grasp(at_least: int, **outcomes: ObjectStatus) -> GraspResult:
    ends = {Finger[name]: how for name, how in outcomes.items()}
    contacts = Finger(sum(axis for axis, how in ends.items() if how.is_contact))
    move = MoveResult(ends, dict.fromkeys(ends, 150), contacts, 1.0, dict.fromkeys(ends, 0), status_of(0xB9))
    return GraspResult(move, at_least)


@pytest.mark.parametrize(
    ("outcomes", "holds"),
    [
        ({"A": CLOSING, "B": CLOSING, "C": CLOSING}, A | B | C),
        ({"A": CLOSING, "B": REACHED, "C": CLOSING}, A | C),
        ({"A": OPENING, "B": CLOSING, "C": REACHED}, B),
        ({"A": REACHED, "B": REACHED, "C": REACHED}, Finger(0)),
    ],
)
def test_what_a_contact_stopped_while_closing_holds(outcomes: dict[str, ObjectStatus], holds: Finger) -> None:
    for at_least in (1, 2, 3):
        result = grasp(at_least, **outcomes)
        assert result.holds == holds
        assert result.is_held == bool(result) == (holds.bit_count() >= at_least)


def test_it_is_told_in_the_words_that_a_person_looks_for() -> None:
    assert repr(grasp(1, A=CLOSING, B=REACHED)) == (
        "<GraspResult held: contact of A, 1 needed; A=150, B=150>"
    )
    assert repr(grasp(2, A=REACHED, B=REACHED)) == (
        "<GraspResult not held: contact of none, 2 needed; A=150, B=150>"
    )
