"""The next image: what the gripper has, with the pending command put in, and nothing else changed."""

from __future__ import annotations

from dataclasses import replace

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.gate import merged
from robotiq_async.control.pending import Pending, changes
from robotiq_async.control.rest import agrees, drifts
from robotiq_async.values.enums import NO_AXES, Finger, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of
from tests.strategies import REQUESTS

A, B, C, S = THREE_FINGER.axes
IN_MOTION, OPENING, CLOSING, THERE = ObjectStatus
AT = (101, 102, 103, 104)
GOING = Request(
    activate=True,
    go=True,
    mode=Mode.WIDE,
    axes=(AxisRequest(10, 1, 5), AxisRequest(20, 2, 6), AxisRequest(30, 3, 7), AxisRequest(40, 4, 8)),
)
HALTED = replace(GOING, go=False)
MOVING = status_of(0x39, 0x00, position=AT)
RESTING = status_of(0x31, 0xFF, position=AT)


def after(
    base: Request,
    pending: Pending,
    status: RobotiqStatus = MOVING,
    *,
    gripping: Finger = NO_AXES,
    may_move: Finger = NO_AXES,
) -> Request:
    return merged(base, pending, status, gripping=gripping, held=places(base, pending, status, may_move))


def places(base: Request, pending: Pending, status: RobotiqStatus, may_move: Finger) -> dict[Finger, int]:
    axes = (axis for axis in THREE_FINGER.axes if axis in pending.hold and base.go)
    return {axis: status.position(axis) for axis in axes if drifts(axis, base, status, may_move)}


def command(
    axes: Finger, position: int | None = None, speed: int | None = None, force: int | None = None
) -> Pending:
    return Pending().merged(changes(axes, position, speed, force))


def hold(axes: Finger) -> Pending:
    return Pending(hold=axes)


def positions(image: Request) -> tuple[int, ...]:
    return tuple(axis.position for axis in image.axes)


# -- the requests ------------------------------------------------------------------------------------------


@pytest.mark.parametrize("base", [GOING, HALTED])
def test_nothing_pending_changes_nothing(base: Request) -> None:
    assert after(base, Pending()) == base


def test_a_position_changes_its_axes_and_no_other() -> None:
    assert after(GOING, command(A | S, 200)) == GOING.with_positions({A: 200, S: 200})


def test_a_speed_and_a_force_change_their_axes_and_start_nothing() -> None:
    image = after(HALTED, command(B, speed=200, force=100))
    assert image == replace(HALTED, axes=(*HALTED.axes[:1], AxisRequest(20, 200, 100), *HALTED.axes[2:]))


# -- waking and holding ------------------------------------------------------------------------------------

AT_REST = status_of(0x39, 0xFF, position=(9, 22, 103, 40))


@pytest.mark.parametrize(
    ("base", "pending", "status", "options", "expected"),
    [
        # Raising rGTO would wake every axis, each to go where it was asked to before the halt. One that
        # gripped keeps its request: asked to be where it is it would touch the object and not hold it.
        (HALTED, command(A, 200), RESTING, {}, (200, 102, 103, 104)),
        (HALTED, command(A, 200), RESTING, {"gripping": B}, (200, 20, 103, 104)),
        # An axis that drifts stays where it is; those at their requests stay so.
        (GOING, hold(A | B), MOVING, {}, (101, 102, 30, 40)),
        (GOING, hold(Finger.ALL), AT_REST, {}, (10, 20, 103, 40)),
        # One that may be about to go is held however close it stands.
        (GOING, hold(Finger.ALL), AT_REST, {"may_move": A | S}, (9, 20, 103, 40)),
        # One in contact keeps its grip while another is held.
        (GOING, hold(A | B), status_of(0x39, 0b00_00_00_10, position=(5, *AT[1:])), {}, (10, 102, 30, 40)),
        (HALTED, hold(Finger.ALL), RESTING, {}, (10, 20, 30, 40)),
    ],
)
def test_axes_not_addressed_stay_or_keep_their_requests(
    base: Request,
    pending: Pending,
    status: RobotiqStatus,
    options: dict[str, Finger],
    expected: tuple[int, ...],
) -> None:
    image = after(base, pending, status, **options)
    assert positions(image) == expected
    assert image.go == (base.go or bool(pending.positions)), "a hold never sets rGTO"


def test_an_axis_may_be_held_while_another_is_sent_somewhere() -> None:
    pending = hold(A | B).merged(changes(B, 200))
    assert positions(after(GOING, pending)) == (101, 200, 30, 40)


# -- anything ----------------------------------------------------------------------------------------------

BYTES = st.integers(0, 255)
IMAGES = REQUESTS.map(lambda base: replace(base, individual_fingers=True, individual_scissor=True))
STATUSES = st.builds(
    status_of,
    st.sampled_from([0x31, 0x39, 0x30, 0x00, 0x11]),
    BYTES,
    position=st.binary(min_size=4, max_size=4),
)
MASKS = st.integers(0, 15).map(Finger)
COMMANDS = st.lists(
    st.tuples(st.integers(1, 15).map(Finger), st.none() | BYTES, st.none() | BYTES, st.none() | BYTES),
    max_size=4,
)


@given(IMAGES, COMMANDS, MASKS, STATUSES, MASKS, MASKS)
def test_an_axis_not_addressed_keeps_its_request_or_stays(
    base: Request,
    commands: list[tuple[Finger, int | None, int | None, int | None]],
    held: Finger,
    status: RobotiqStatus,
    gripping: Finger,
    may_move: Finger,
) -> None:
    pending = Pending(hold=held)
    for each in commands:
        pending = pending.merged(changes(*each))
    stopped = places(base, pending, status, may_move)
    image = merged(base, pending, status, gripping=gripping, held=stopped)
    assert (image.mode, image.individual_fingers, image.individual_scissor) == (base.mode, True, True)
    assert image.go == (base.go or bool(pending.positions))
    for axis, before, now in zip(THREE_FINGER.axes, base.axes, image.axes, strict=True):
        assert now.speed == pending.speeds.get(axis, before.speed)
        assert now.force == pending.forces.get(axis, before.force)
        if axis in pending.positions:
            assert now.position == pending.positions[axis]
        else:
            assert now.position in (before.position, status.position(axis))
        if base.go and axis not in pending.hold and axis not in pending.positions:
            assert now.position == before.position


# -- requests that follow from position, contact and motion ------------------------------------------------


@pytest.mark.parametrize(
    ("request_", "what", "position", "direction", "expected"),
    [
        # At the requested position, within one or two counts.
        (100, THERE, 100, 0, True),
        (100, THERE, 98, 0, True),
        (100, THERE, 102, 0, True),
        (100, THERE, 97, 0, False),
        (100, THERE, 103, 0, False),
        # Fully open reads 6-7 for a request of 0, fully closed 240 or more for one of 255.
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
        (200, IN_MOTION, 100, 0, True),
        (200, IN_MOTION, 100, 5, True),
        (200, IN_MOTION, 100, -5, False),
        (0, IN_MOTION, 100, 5, False),
        (0, IN_MOTION, 100, -5, True),
        (100, IN_MOTION, 100, 0, False),
        (100, IN_MOTION, 100, 5, False),
    ],
)
def test_a_request_agrees_with_what_an_axis_does(
    request_: int, what: ObjectStatus, position: int, direction: int, expected: bool
) -> None:
    assert agrees(THREE_FINGER, request_, what, position, direction) is expected


# -- whether an axis needs a request to stay ---------------------------------------------------------------


@pytest.mark.parametrize("may_move", [NO_AXES, A])
@pytest.mark.parametrize(
    ("request_", "what", "position", "held"),
    [
        (200, IN_MOTION, 100, True),
        (100, IN_MOTION, 100, True),
        # In contact it keeps its request, and with it its grip.
        (255, CLOSING, 150, None),
        (151, CLOSING, 150, None),
        (0, OPENING, 150, None),
        (20, CLOSING, 150, True),  # a grip by the request before, about to end
        (100, THERE, 97, True),
        (100, THERE, 98, None),
        (100, THERE, 100, False),
        (100, THERE, 102, None),
    ],
)
def test_an_axis_that_moves_or_is_about_to_is_asked_to_stay(
    request_: int, what: ObjectStatus, position: int, held: bool | None, may_move: Finger
) -> None:
    """Close to its request, or in contact (None), it is held only in doubt: it may be about to go."""
    status = status_of(0x39, what, position=position)
    going = Request(activate=True, go=True, axes=(AxisRequest(request_),) * 4)
    expected = bool(may_move) if held is None else held
    assert drifts(A, going, status, may_move) is (expected and not (may_move and request_ == position))
