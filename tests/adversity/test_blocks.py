"""The event loop is held up in each turn around a stop: the fingers stop. blocks.py tries all of it."""

from __future__ import annotations

import pytest

from tests.adversity.blocks import CALLS, Case, Place, life
from tests.virtual import run

PLACES = [Place("clean-up"), Place("listener"), *(Place("turn", turn) for turn in range(1, 13, 2))]


@pytest.mark.parametrize("place", [*PLACES, Place("turn", 3, times=6)], ids=str)
@pytest.mark.parametrize("call", CALLS)
def test_the_fingers_stop_wherever_the_loop_is_held_up(call: str, place: Place) -> None:
    """In 152 of 1,200 places around a stop a block left the fingers moving."""
    for block, moment in ((1.5, 0.0), (10.0, 0.0023)):
        case = Case(call, place, block, moment)
        assert run(lambda case=case: life(case)) == "", case  # type: ignore[misc]
