"""The event loop is held up in each turn around a stop: the fingers stop.

blocks.py tries all of it in virtual time, and blocked.py with the gripper in another process.
"""

from __future__ import annotations

import sys

import pytest

from tests.adversity import blocked
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


@pytest.mark.skipif(sys.platform == "win32", reason="SIGTERM ends a process there at once")
async def test_a_gripper_in_another_process_stops_before_whoever_hears_of_it_can_hold_up_the_loop() -> None:
    """Clean-ups and listeners ran before the write; after a block of 2 s in the loop there was none."""
    in_clean_up = [Case(call, Place("clean-up"), 0.0, 0.0) for call in blocked.CALLS]
    stops = ("stop", "signal", "halt", "reset", "hold")
    in_listener = [Case(call, Place("listener"), 0.0, 0.0) for call in stops]
    turns = {"stop": 0, "leave": 3, "signal": 3, "halt": 8}
    in_turn = [Case(call, Place("turn", turn), 2.0, 0.0) for call, turn in turns.items()]
    assert await blocked.judge([*in_clean_up, *in_listener, *in_turn]) == {}
