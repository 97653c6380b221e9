"""What a position, a contact and a motion tell about the request that an axis follows."""

from __future__ import annotations

import pytest

from robotiq_async.control.contact import agrees, drifts
from robotiq_async.values.enums import Finger, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes
MOVING, OPENING, CLOSING, THERE = ObjectStatus


@pytest.mark.parametrize(
    ("request_", "what", "position", "direction", "expected"),
    [
        # At the requested position, within one or two counts.
        (100, THERE, 100, 0, True),
        (100, THERE, 98, 0, True),
        (100, THERE, 102, 0, True),
        (100, THERE, 97, 0, False),
        (100, THERE, 103, 0, False),
        # Fully open reads 6-7 although 0 was asked, fully closed 240 or more although 255 was asked.
        (0, THERE, 6, 0, True),
        (0, THERE, 7, 0, True),
        (0, THERE, 20, 0, False),
        (255, THERE, 240, 0, True),
        (255, THERE, 241, 0, True),
        (255, THERE, 255, 0, True),
        (255, THERE, 230, 0, False),
        (0, THERE, 137, 0, False),
        # A contact while closing needs a request further closed, one while opening further open.
        (151, CLOSING, 150, 0, True),
        (150, CLOSING, 150, 0, False),
        (0, CLOSING, 150, 0, False),
        (149, OPENING, 150, 0, True),
        (150, OPENING, 150, 0, False),
        (255, OPENING, 150, 0, False),
        # A moving axis goes towards its request.
        (200, MOVING, 100, 0, True),
        (200, MOVING, 100, 5, True),
        (200, MOVING, 100, -5, False),
        (0, MOVING, 100, 5, False),
        (0, MOVING, 100, -5, True),
        (100, MOVING, 100, 0, False),
        (100, MOVING, 100, 5, False),
    ],
)
def test_a_request_agrees_with_what_an_axis_does(
    request_: int, what: ObjectStatus, position: int, direction: int, expected: bool
) -> None:
    assert agrees(THREE_FINGER, request_, what, position, direction) is expected


# -- whether an axis has to be asked to stay ---------------------------------------------------------------


def is_held(
    request: int, what: ObjectStatus, position: int, *, go: bool = True, arrived: Finger = Finger.ALL
) -> bool:
    """Whether holding axis A means asking for where it is."""
    base = Request(activate=True, go=go, axes=(AxisRequest(request),) * 4)
    return drifts(A, base, status_of(0x31 | go << 3, what, position=position), arrived)


def test_a_moving_axis_drifts_wherever_it_goes() -> None:
    assert is_held(200, MOVING, 100)
    assert is_held(100, MOVING, 100)


@pytest.mark.parametrize(("request_", "what"), [(255, CLOSING), (151, CLOSING), (0, OPENING)])
def test_an_axis_in_contact_keeps_its_request_and_its_grip(request_: int, what: ObjectStatus) -> None:
    assert not is_held(request_, what, 150)
    assert not is_held(request_, what, 150, arrived=Finger(0))


def test_a_grip_that_comes_from_the_request_before_is_about_to_end() -> None:
    assert is_held(20, CLOSING, 150)


@pytest.mark.parametrize("position", [98, 100, 102])
def test_an_axis_that_stands_where_it_was_asked_to_keeps_its_request(position: int) -> None:
    assert not is_held(100, THERE, position)


def test_an_axis_that_stands_somewhere_else_is_about_to_go() -> None:
    assert is_held(100, THERE, 97)


@pytest.mark.parametrize(("position", "held"), [(98, True), (100, False), (102, True)])
def test_an_axis_close_to_its_request_that_has_not_arrived_may_be_about_to_go(
    position: int, held: bool
) -> None:
    assert is_held(100, THERE, position, arrived=B | C | S) is held


@pytest.mark.parametrize("what", ObjectStatus)
def test_nothing_drifts_while_rgto_is_clear(what: ObjectStatus) -> None:
    assert not is_held(100, what, 50, go=False, arrived=Finger(0))
