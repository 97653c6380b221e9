"""Objects in the way: contacts, their latch and their release."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.simulator.physics.axis import PRESSING
from robotiq_async.values.enums import Finger, ObjectStatus
from tests.simulator.conftest import CYCLE
from tests.simulator.stories import tell

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

OPENING, CLOSING = ObjectStatus.CONTACT_OPENING, ObjectStatus.CONTACT_CLOSING
MOVING, ARRIVED = ObjectStatus.IN_MOTION, ObjectStatus.AT_POSITION


def where(bench: Bench, axis: Finger) -> tuple[int, ObjectStatus]:
    """Where an axis is, and what it says of itself."""
    return bench.gripper.position(axis), bench.status.finger_status(axis)


HOLDING = "individual, place A 150, reach A=200 force=100, A closing at 150"
INTO_SOMETHING_SOFT = (
    ("closing", "individual, reach 0, place A 120 soft=51, reach A=255 force=100", "A=255", 140, 150),
    ("opening", "individual, reach 255, place A 120 opening soft=51, reach A=0 force=100", "A=0", 100, 90),
)
"""It gives way by 51 counts under full force, by 20 under 100, by 30 under 150."""

STORIES = {
    "a contact stops only its axis": "individual, place B 150, reach 220, at 220 150 220 220, A arrived, "
    "B closing, C arrived, S arrived",
    **{
        f"{axis} feels both directions": f"individual, place {axis} 180, place {axis} 60 opening, "
        f"reach {axis}=255, {axis} closing at 180, reach {axis}=0, {axis} opening at 60"
        for axis in "ABCS"
    },
    "a request that ends at the object is no contact": "individual, place A 150, reach A=150, "
    "A arrived at 150",
    **{
        f"it latches against {target} on the same side": f"{HOLDING}, note, go A={target} force=100, wait 5, "
        "A closing, still"
        for target in (151, 255)
    },
    # A finger that locks itself does not follow; gDT says so until more is asked for.
    "it latches when its object gives way or is gone": f"{HOLDING}, place A 170, wait 5, A closing at 150, "
    "remove A, go A=255 force=100, wait 5, A closing at 150",
    **{
        f"the object is gone, {how}": f"{HOLDING}, remove A, {how}, A moving, settle, A arrived at 200"
        for how in (
            "go A=200 force=101",
            "write rGTO=0, write rGTO=1",
            "reach A=100 force=100, A arrived at 100, go A=200 force=100",
        )
    },
    **{
        f"a second try at something rigid is a motion first: {how}": f"{HOLDING}, note, {how}, "
        f"A moving at 150, words 39 FC, wait {PRESSING}, A closing at 150, still"
        for how in ("write rGTO=0, A closing at 150, write rGTO=1", "go A=200 force=200")
    },
    **{
        f"{way}, more force tries again and latches again": f"{begun}, A {way} at {near}, "
        f"go {target} force=150, A moving, settle, A {way} at {far}"
        for way, begun, target, near, far in INTO_SOMETHING_SOFT
    },
    **{
        f"{way}, less force changes nothing{halt}": f"{begun}{halt}, go {target} force=0, wait 5, "
        f"A {way} at {near}"
        for way, begun, target, near, _ in INTO_SOMETHING_SOFT
        for halt in ("", ", write rGTO=0")
    },
    "a thin object is never flagged": "individual, place ABC 220 thin, reach 255, at 241 241 241, "
    "words F9 FF",
    "a thin object takes the place of another": "individual, place ABC 150, place A 150 thin, reach 255, "
    "A arrived, B closing, C closing",
    "one behind the axis is met from the other side only": "individual, reach 200, place A 150, reach A=230, "
    "A arrived at 230, reach A=100, A arrived at 100, reach A=230, A closing at 150",
    "also in the other direction": "individual, reach 100, place A 150 opening, reach A=50, A arrived at 50, "
    "reach A=230, A arrived at 230, reach A=50, A opening at 150",
    "one that is dropped into the way": "individual, go A=255, wait 0.5, place A 180, settle, "
    "A closing at 180",
    "it is taken out for an activation and put back": "on, place ABC 150, write rACT=1, settle, "
    "state complete, travel A 470, reach 255, at 150 150 150",
    **{
        f"an activation fails at something fixed: {what}": f"on, place {what} fixed, write rACT=1 rMOD=1, "
        "settle, fault 13, state activating, remove, wait 60, fault 13, write rACT=0, write rACT=1, settle, "
        "state complete, fault 0"
        for what in ("A 90", "B 8", "C 90 opening", "S 180")
    },
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


def test_an_object_that_goes_while_the_axis_presses_lets_it_go_on(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 60)
    individual.go({Finger.A: 200})
    while individual.gripper.position(Finger.A) < 60:
        individual.wait(CYCLE)
    assert individual.status.finger_status(Finger.A) is MOVING
    individual.gripper.remove_object()
    individual.settle()
    assert where(individual, Finger.A) == (200, ARRIVED)


def test_requests_in_every_cycle_do_not_put_off_the_contact(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 50)
    touched = None
    for cycle in range(200):
        individual.go({Finger.A: 100 + cycle % 100})
        if individual.status.finger_status(Finger.A) is CLOSING:
            break
        if touched is None and individual.gripper.position(Finger.A) == 50:
            touched = individual.now
    assert touched is not None
    assert individual.now - touched == pytest.approx(PRESSING, abs=2 * CYCLE)
    assert where(individual, Finger.A) == (50, CLOSING)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fingers": 0, "position": 1}, "fingers"),
        ({"fingers": 16, "position": 1}, "fingers"),
        ({"fingers": 1, "position": 256}, "position"),
        ({"fingers": 1, "position": 1, "soft": -1}, "soft"),
        ({"fingers": 1, "position": 256, "thin": True}, "position"),
    ],
)
def test_bad_arguments(bench: Bench, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bench.gripper.place_object(**arguments)
