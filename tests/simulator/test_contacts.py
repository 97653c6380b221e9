"""Objects in the way: contacts, their latch and their release."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.calibration.motion_profile import PRESSING_S
from robotiq_async.simulator import Habits
from robotiq_async.values.enums import NO_AXES, Fault, Finger, Initialization, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from tests.simulator.conftest import CYCLE

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

OPENING, CLOSING = ObjectStatus.CONTACT_OPENING, ObjectStatus.CONTACT_CLOSING
MOVING, ARRIVED = ObjectStatus.IN_MOTION, ObjectStatus.AT_POSITION


def where(bench: Bench, axis: Finger) -> tuple[int, ObjectStatus]:
    """The position of an axis, and its object status."""
    return bench.gripper.position(axis), bench.status.finger_status(axis)


@pytest.fixture
def holding(individual: Bench) -> Bench:
    """Finger A holds something at 150, on its way to 200 with force 100."""
    individual.gripper.place_object(Finger.A, 150)
    individual.reach({Finger.A: 200}, force=100)
    assert individual.status.finger_status(Finger.A) is CLOSING
    return individual


def test_a_contact_stops_only_its_axis(individual: Bench) -> None:
    individual.gripper.place_object(Finger.B, 150)
    individual.reach(220)
    assert individual.positions == (220, 150, 220, 220)
    assert individual.outcomes == (ARRIVED, CLOSING, ARRIVED, ARRIVED)


@pytest.mark.parametrize("axis", THREE_FINGER.axes)
def test_every_axis_feels_both_directions(individual: Bench, axis: Finger) -> None:
    individual.gripper.place_object(axis, 180)
    individual.gripper.place_object(axis, 60, opening=True)
    individual.reach({axis: 255})
    assert where(individual, axis) == (180, CLOSING)
    individual.reach({axis: 0})
    assert where(individual, axis) == (60, OPENING)


@pytest.mark.parametrize("lets_go", [False, True])
def test_an_axis_grips_while_it_is_driven_against_what_it_touches(individual: Bench, lets_go: bool) -> None:
    """By the vendor a part stays held when rGTO is cleared; as no one measured it, it may be otherwise."""
    individual.gripper.habits = Habits(lets_go_on_halt=lets_go)
    individual.gripper.place_object(Finger.A, 150)
    individual.gripper.place_object(Finger.B, 60, opening=True)
    individual.reach({Finger.B: 255})
    assert not individual.gripper.grips
    individual.go({Finger.A: 200, Finger.B: 0})
    assert not individual.gripper.grips, "they are on their way"
    individual.settle()
    assert individual.gripper.grips == Finger.A | Finger.B
    individual.write(go=False)
    assert not individual.gripper.grips
    assert individual.gripper.holds == (NO_AXES if lets_go else Finger.A | Finger.B)
    assert where(individual, Finger.A) == (150, CLOSING), "it stands where it was, and still tells of it"
    individual.write_and_settle(go=True)
    assert individual.gripper.grips == individual.gripper.holds == Finger.A | Finger.B
    individual.go({Finger.A: 150})
    assert individual.gripper.grips == individual.gripper.holds == Finger.B, "asked to be where it is: let go"
    assert where(individual, Finger.A) == (150, ARRIVED)


def test_a_request_that_ends_at_the_object_is_no_contact(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 150)
    individual.reach({Finger.A: 150})
    assert individual.status.finger_status(Finger.A) is ARRIVED


@pytest.mark.parametrize("target", [151, 255])
def test_a_contact_latches_against_requests_on_the_same_side(holding: Bench, target: int) -> None:
    before = holding.gripper.travel(Finger.A)
    holding.go({Finger.A: target}, force=100)
    holding.wait(5)
    assert holding.status.finger_status(Finger.A) is CLOSING
    assert holding.gripper.travel(Finger.A) == before


def test_a_contact_latches_when_its_object_gives_way_or_is_gone(holding: Bench) -> None:
    """A finger that locks itself does not follow; gDT has it until more is requested."""
    holding.gripper.place_object(Finger.A, 170)
    holding.wait(5)
    assert where(holding, Finger.A) == (150, CLOSING)
    holding.gripper.remove_object(Finger.A)
    holding.go({Finger.A: 255}, force=100)
    holding.wait(5)
    assert where(holding, Finger.A) == (150, CLOSING)


@pytest.mark.parametrize("how", ["more force", "rGTO", "the other side and back"])
def test_an_axis_goes_on_when_its_contact_ends_and_the_object_is_gone(holding: Bench, how: str) -> None:
    holding.gripper.remove_object(Finger.A)
    if how == "more force":
        holding.go({Finger.A: 200}, force=101)
    elif how == "rGTO":
        holding.write(go=False)
        holding.write(go=True)
    else:
        holding.reach({Finger.A: 100}, force=100)
        assert where(holding, Finger.A) == (100, ARRIVED)
        holding.go({Finger.A: 200}, force=100)
    assert holding.status.finger_status(Finger.A) is MOVING
    holding.settle()
    assert where(holding, Finger.A) == (200, ARRIVED)


def test_an_object_that_goes_while_the_axis_presses_lets_it_go_on(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 60)
    individual.go({Finger.A: 200})
    while individual.gripper.position(Finger.A) < 60:
        individual.wait(CYCLE)
    assert individual.status.finger_status(Finger.A) is MOVING
    individual.gripper.remove_object()
    individual.settle()
    assert where(individual, Finger.A) == (200, ARRIVED)


@pytest.fixture(params=[CLOSING, OPENING], ids=["closing", "opening"])
def pressing(request: pytest.FixtureRequest, individual: Bench) -> Bench:
    """Finger A presses into something soft at 120, which gives way by 51 counts under full force."""
    opening = request.param is OPENING
    individual.reach(0 if not opening else 255)
    individual.gripper.place_object(Finger.A, 120, opening=opening, soft=51)
    individual.reach({Finger.A: 0 if opening else 255}, force=100)
    assert depth(individual) == 20
    assert individual.status.finger_status(Finger.A) is request.param
    return individual


def depth(bench: Bench) -> int:
    return abs(bench.gripper.position(Finger.A) - 120)


def again(bench: Bench, *, force: int) -> None:
    """Repeat the request of finger A with another force."""
    bench.go({Finger.A: bench.status.requested_position(Finger.A)}, force=force)


def test_more_force_tries_again_and_latches_again(pressing: Bench) -> None:
    again(pressing, force=150)
    assert pressing.status.finger_status(Finger.A) is MOVING
    pressing.settle()
    assert depth(pressing) == 30
    assert pressing.status.finger_status(Finger.A).is_contact


@pytest.mark.parametrize("halted", [False, True])
def test_less_force_changes_nothing(pressing: Bench, halted: bool) -> None:
    if halted:
        pressing.write(go=False)
    again(pressing, force=0)
    pressing.wait(5)
    assert depth(pressing) == 20
    assert pressing.status.finger_status(Finger.A).is_contact


@pytest.mark.parametrize("how", ["rGTO", "more force"])
def test_a_second_try_at_something_rigid_is_a_motion_before_it_is_a_contact(holding: Bench, how: str) -> None:
    before = holding.gripper.travel(Finger.A)
    if how == "rGTO":
        holding.write(go=False)
        assert where(holding, Finger.A) == (150, CLOSING)
        holding.write(go=True)
    else:
        again(holding, force=200)
    assert where(holding, Finger.A) == (150, MOVING)
    assert holding.status.is_moving
    holding.wait(PRESSING_S)
    assert where(holding, Finger.A) == (150, CLOSING)
    assert holding.gripper.travel(Finger.A) == before


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
    assert individual.now - touched == pytest.approx(PRESSING_S, abs=2 * CYCLE)
    assert where(individual, Finger.A) == (50, CLOSING)


def test_a_thin_object_is_never_flagged(individual: Bench) -> None:
    individual.gripper.place_object(Finger.ABC, 220, thin=True)
    individual.close()
    assert individual.positions[:3] == (241, 241, 241)
    assert individual.words == (0xF9, 0xFF)


def test_a_thin_object_takes_the_place_of_another(individual: Bench) -> None:
    individual.gripper.place_object(Finger.ABC, 150)
    individual.gripper.place_object(Finger.A, 150, thin=True)
    individual.close()
    assert individual.outcomes[:3] == (ARRIVED, CLOSING, CLOSING)


@pytest.mark.parametrize(("opening", "start", "on", "far"), [(False, 200, 230, 100), (True, 100, 50, 230)])
def test_an_object_placed_behind_the_axis_is_met_from_the_other_side_only(
    individual: Bench, opening: bool, start: int, on: int, far: int
) -> None:
    individual.reach(start)
    individual.gripper.place_object(Finger.A, 150, opening=opening)
    for target, reached in ((on, on), (far, far), (on, 150)):
        individual.reach({Finger.A: target})
        assert individual.gripper.position(Finger.A) == reached


def test_an_object_dropped_into_the_way_stops_a_motion(individual: Bench) -> None:
    individual.go({Finger.A: 255})
    individual.wait(0.5)
    individual.gripper.place_object(Finger.A, 180)
    individual.settle()
    assert where(individual, Finger.A) == (180, CLOSING)


def test_for_an_activation_an_object_is_taken_out_and_put_back(bench: Bench) -> None:
    bench.gripper.place_object(Finger.ABC, 150)
    bench.activate()
    assert bench.gripper.travel(Finger.A) == 2 * 235
    bench.close()
    assert bench.positions[:3] == (150, 150, 150)


@pytest.mark.parametrize(
    ("axis", "position", "opening"),
    [(Finger.A, 90, False), (Finger.B, 8, False), (Finger.C, 90, True), (Finger.SCISSOR, 180, False)],
)
def test_activation_with_something_fixed_in_the_way_fails(
    bench: Bench, axis: Finger, position: int, opening: bool
) -> None:
    bench.gripper.place_object(axis, position, opening=opening, fixed=True)
    bench.write_and_settle(activate=True, mode=Mode.PINCH)
    assert bench.fault is Fault.ACTIVATION_FAULT
    assert bench.status.initialization is Initialization.ACTIVATING
    bench.gripper.remove_object()
    bench.wait(60)
    assert bench.fault is Fault.ACTIVATION_FAULT, "only a reset helps"
    bench.write(activate=False)
    bench.activate()
    assert bench.fault is Fault.NONE


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
