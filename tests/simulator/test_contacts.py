"""Objects in the way: contacts, their latch and their release."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

import pytest

from robotiq_async.enums import AXES, Finger, ObjectStatus

if TYPE_CHECKING:
    from tests.simulator.conftest import Bench

OPENING, CLOSING = ObjectStatus.CONTACT_OPENING, ObjectStatus.CONTACT_CLOSING
MOVING, ARRIVED = ObjectStatus.IN_MOTION, ObjectStatus.AT_POSITION


def where(bench: Bench, axis: Finger) -> tuple[int, ObjectStatus]:
    """Where an axis is, and what it says of itself."""
    return bench.gripper.position(axis), bench.status.finger_status(axis)


@pytest.fixture
def holding(individual: Bench) -> Bench:
    """Finger A holds something at 150, on its way to 200 with force 100."""
    individual.gripper.place_object(Finger.A, 150)
    individual.go({Finger.A: 200}, force=100)
    individual.settle()
    assert individual.status.finger_status(Finger.A) is CLOSING
    return individual


def test_a_contact_stops_only_its_axis(individual: Bench) -> None:
    individual.gripper.place_object(Finger.B, 150)
    individual.close(220)
    assert individual.positions == (220, 150, 220, 220)
    assert individual.outcomes == (ARRIVED, CLOSING, ARRIVED, ARRIVED)


@pytest.mark.parametrize("axis", AXES)
def test_every_axis_feels_both_directions(individual: Bench, axis: Finger) -> None:
    individual.gripper.place_object(axis, 180)
    individual.gripper.place_object(axis, 60, opening=True)
    individual.go({axis: 255})
    individual.settle()
    assert where(individual, axis) == (180, CLOSING)
    individual.go({axis: 0})
    individual.settle()
    assert where(individual, axis) == (60, OPENING)


def test_a_request_that_ends_at_the_object_is_no_contact(individual: Bench) -> None:
    individual.gripper.place_object(Finger.A, 150)
    individual.go({Finger.A: 150})
    individual.settle()
    assert individual.status.finger_status(Finger.A) is ARRIVED


@pytest.mark.parametrize("target", [151, 199, 201, 255])
def test_a_contact_latches_against_requests_on_the_same_side(holding: Bench, target: int) -> None:
    before = holding.gripper.travel(Finger.A)
    holding.go({Finger.A: target}, force=100)
    holding.wait(5)
    assert holding.status.finger_status(Finger.A) is CLOSING
    assert holding.gripper.travel(Finger.A) == before


def test_an_object_that_gives_way_lets_the_axis_follow(holding: Bench) -> None:
    holding.gripper.place_object(Finger.A, 170)
    holding.settle()
    assert where(holding, Finger.A) == (170, CLOSING)


def test_removing_the_object_lets_the_axis_go_on(holding: Bench) -> None:
    holding.gripper.remove_object(Finger.A)
    assert holding.status.finger_status(Finger.A) is MOVING
    holding.settle()
    assert where(holding, Finger.A) == (200, ARRIVED)


def test_removing_another_axis_object_changes_nothing(holding: Bench) -> None:
    holding.gripper.remove_object(Finger.B | Finger.C)
    holding.wait(5)
    assert holding.status.finger_status(Finger.A) is CLOSING


def test_removing_the_object_while_halted_moves_nothing(holding: Bench) -> None:
    holding.write(go=False)
    holding.gripper.remove_object()
    holding.wait(5)
    assert holding.gripper.position(Finger.A) == 150
    holding.write(go=True)
    holding.settle()
    assert holding.gripper.position(Finger.A) == 200


def test_a_position_on_the_other_side_releases(holding: Bench) -> None:
    holding.go({Finger.A: 100}, force=100)
    assert holding.status.finger_status(Finger.A) is MOVING
    holding.settle()
    assert where(holding, Finger.A) == (100, ARRIVED)


def test_retargeting_to_the_reading_relaxes_the_grip(holding: Bench) -> None:
    assert holding.status.current(Finger.A) > 0
    holding.go({Finger.A: 150}, force=100)
    assert holding.status.finger_status(Finger.A) is ARRIVED
    assert holding.status.current(Finger.A) == 0


@pytest.fixture(params=[CLOSING, OPENING], ids=["closing", "opening"])
def pressing(request: pytest.FixtureRequest, individual: Bench) -> Bench:
    """Finger A presses into something soft at 120, which gives way by 51 counts under full force."""
    opening = request.param is OPENING
    individual.close(0 if not opening else 255)
    individual.gripper.place_object(Finger.A, 120, opening=opening, soft=51)
    individual.go({Finger.A: 0 if opening else 255}, force=100)
    individual.settle()
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


def test_less_force_changes_nothing(pressing: Bench) -> None:
    again(pressing, force=0)
    pressing.wait(5)
    assert depth(pressing) == 20
    assert pressing.status.finger_status(Finger.A).is_contact


def test_going_again_with_less_force_stays_in_a_soft_object(pressing: Bench) -> None:
    pressing.write(go=False)
    again(pressing, force=0)
    pressing.wait(5)
    assert depth(pressing) == 20
    assert pressing.status.finger_status(Finger.A).is_contact


def test_going_again_tries_again(holding: Bench) -> None:
    holding.write(go=False)
    holding.gripper.place_object(Finger.A, 160)
    holding.write(go=True)
    holding.settle()
    assert where(holding, Finger.A) == (160, CLOSING)


@pytest.mark.parametrize(("opening", "start", "on", "far"), [(False, 200, 230, 100), (True, 100, 50, 230)])
def test_an_object_placed_behind_the_axis_is_met_from_the_other_side_only(
    individual: Bench, opening: bool, start: int, on: int, far: int
) -> None:
    individual.close(start)
    individual.gripper.place_object(Finger.A, 150, opening=opening)
    for target, reached in ((on, on), (far, far), (on, 150)):
        individual.go({Finger.A: target})
        individual.settle()
        assert individual.gripper.position(Finger.A) == reached


def test_an_object_dropped_into_the_way_stops_a_motion(individual: Bench) -> None:
    individual.go({Finger.A: 255})
    individual.wait(0.5)
    individual.gripper.place_object(Finger.A, 180)
    individual.settle()
    assert where(individual, Finger.A) == (180, CLOSING)


def test_activation_with_an_object_in_the_way_succeeds(bench: Bench) -> None:
    bench.gripper.place_object(Finger.ABC, 150)
    bench.activate()
    assert bench.gripper.travel(Finger.A) == 2 * (150 - 6)


@pytest.mark.parametrize(
    ("arguments", "message"),
    [
        ({"fingers": 0, "position": 1}, "fingers"),
        ({"fingers": 16, "position": 1}, "fingers"),
        ({"fingers": 1, "position": 256}, "position"),
        ({"fingers": 1, "position": 1, "soft": -1}, "soft"),
    ],
)
def test_bad_arguments(bench: Bench, arguments: dict[str, Any], message: str) -> None:
    with pytest.raises(ValueError, match=message):
        bench.gripper.place_object(**arguments)
