"""The shadow of the requests: which axes grip, and which have come to rest."""

from __future__ import annotations

import pytest

from robotiq_async.control.requests.shadow import Whose
from robotiq_async.values.enums import NO_AXES, Finger
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import Shadow, image, shows
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes

GRIP = status_of(0x39, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))
"""A, B and the scissor touch something."""
HALTED = status_of(0x31, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))


def gripping(ours: Shadow, status: RobotiqStatus = HALTED) -> Finger:
    return ours.axes.grips.held(status, ours.base)


def test_what_gripped_when_rgto_was_last_set_still_does(ours: Shadow) -> None:
    ours.axes.see(GRIP, ours.now)
    assert gripping(ours, GRIP) == A | B | S
    ours.axes.see(status_of(0x31, 0xFF, echo=200, position=150), ours.now)
    assert gripping(ours) == A | B | S, "gDT is not worth reading while rGTO is clear"


def test_an_axis_that_is_somewhere_else_by_now_does_not_grip(ours: Shadow) -> None:
    ours.axes.see(GRIP, ours.now)
    assert gripping(ours, status_of(0x31, 0xFF, position=(150, 6, 6, 152))) == A | S


def test_a_grip_by_another_request_than_the_one_in_force_is_none(ours: Shadow) -> None:
    """A motion that was halted must not come back because the axis had gripped."""
    ours.axes.see(GRIP, ours.now)
    ours.write(image(200).with_positions({A: 20}), moved=NO_AXES)
    assert gripping(ours) == B | S


@pytest.mark.parametrize("how", ["moved", "adopted", "sequence"])
def test_a_grip_ends(ours: Shadow, how: str) -> None:
    ours.axes.see(GRIP, ours.now)
    match how:
        case "moved":
            ours.write(image(200), moved=A)
        case "adopted":
            ours.follow(Whose.FOREIGN, GRIP)
        case "sequence":
            ours.axes.grips.forget()
    assert gripping(ours) == (B | S if how == "moved" else NO_AXES)


def test_an_axis_has_arrived_when_it_was_seen_at_rest_under_what_it_was_asked_last(ours: Shadow) -> None:
    assert ours.axes.resting == NO_AXES
    ours.axes.see(status_of(0x39, 0b11_11_10_00, echo=200, position=(100, 150, 199, 200)), ours.now)
    assert ours.axes.resting == B | C | S
    ours.write(image(200).with_positions({B: 190}), moved=B)
    assert ours.axes.resting == C | S


def test_no_axis_arrives_under_what_does_not_act_yet(ours: Shadow) -> None:
    ours.write(image(30), moved=A)
    ours.axes.see(ours.shown(shows(200, 1.2), 1.2), ours.now)
    assert A not in ours.axes.resting


def test_no_axis_arrives_while_rgto_is_clear(ours: Shadow) -> None:
    ours.write(image(200, go=False))
    ours.axes.see(ours.shown(shows(200, 1.2, go=False), 1.2), ours.now)
    assert ours.axes.resting == NO_AXES


def test_an_axis_that_we_never_moved_counts_as_arrived(shadow: Shadow) -> None:
    assert shadow.axes.resting == Finger.ALL
