"""The first motion on a new connection: which axes should move, and from where they are watched."""

from __future__ import annotations

import pytest

from robotiq_async.control.first_motion import IGNORED_S, FirstMotion
from robotiq_async.control.requests.standstill import LAG_READS, Moment
from robotiq_async.values.enums import Finger
from robotiq_async.values.model import HAND_E, THREE_FINGER, TOLERANCE
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import registers_of, status_of

A, B, C, S = THREE_FINGER.axes
ACTIVE = 0x39
NONE, BEGUN, LONG = Finger(0), Moment(1.0, 1), Moment(1.0 + IGNORED_S, 1 + LAG_READS)


def at(**positions: int) -> RobotiqStatus:
    """A status of an active 3-Finger whose axes rest, at 50 unless said otherwise."""
    a, b, c, s = (positions.get(axis.name or "", 50) for axis in THREE_FINGER.axes)
    return status_of(ACTIVE, 0xFF, echo=(a, b, c, s), position=(a, b, c, s))


def going(status: RobotiqStatus, **positions: int) -> Request:
    axes = (AxisRequest(positions.get(axis.name or "", status.position(axis))) for axis in status.model.axes)
    return Request(activate=True, go=True, axes=tuple(axes), model=status.model)


def watching(status: RobotiqStatus, moved: Finger) -> FirstMotion:
    first = FirstMotion()
    first.connected()
    first.written(1, moved, status)
    return first


def ignored(first: FirstMotion, status: RobotiqStatus, base: Request) -> Finger:
    """The axes that do not follow when nothing changes for so long."""
    first.see(status, base, lambda _: True, BEGUN)
    still, is_long = first.see(status, base, lambda _: True, LONG)
    assert is_long is bool(still)
    return still


@pytest.mark.parametrize(
    ("axis", "position", "request_", "beside", "is_expected"),
    [
        (S, 21, 0, {}, True),
        (S, 20, 0, {}, False),
        (S, 224, 255, {}, True),
        (S, 225, 255, {}, False),
        (A, 99, 255, {"SCISSOR": 160}, True),
        (A, 100, 255, {"SCISSOR": 160}, False),
        (A, 100, 255, {"SCISSOR": 159}, True),
        (A, 200, 100, {"SCISSOR": 160}, True),
    ],
)
def test_at_a_limit_an_axis_is_not_expected_to_move(
    axis: Finger, position: int, request_: int, beside: dict[str, int], is_expected: bool
) -> None:
    status = at(**beside, **{axis.name or "": position})
    base = going(status, **{axis.name or "": request_})
    assert ignored(watching(status, axis), status, base) == (axis if is_expected else NONE)


def test_a_jaw_has_no_such_limits() -> None:
    status = RobotiqStatus(registers_of([0xF9, 0, 0, 210, 210, *[0] * 11]), 0.0, 1, HAND_E)
    assert ignored(watching(status, A), status, going(status, A=255)) == A


@pytest.mark.parametrize(("counts", "follows"), [(TOLERANCE, False), (TOLERANCE + 1, True)])
def test_a_motion_beyond_the_tolerance_counts_as_following(counts: int, follows: bool) -> None:
    status = at()
    first = watching(status, A)
    first.see(status, going(status, A=200), lambda _: True, BEGUN)
    later = at(A=50 + counts)
    assert first.see(later, going(status, A=200), lambda _: True, LONG) == (
        NONE if follows else A,
        not follows,
    )


def test_a_second_motion_before_the_first_is_followed_adds_its_axes() -> None:
    status = at()
    first = watching(status, A)
    first.written(2, B, status)
    assert ignored(first, status, going(status, A=200, B=200)) == A | B


@pytest.mark.parametrize("again", [True, False])
def test_the_next_motion_is_watched_from_where_it_begins(again: bool) -> None:
    """After another connection, and after a request that asked for no motion."""
    status = at()
    first = watching(status, A)
    if again:
        first.connected()
    else:
        assert ignored(first, status, going(status)) == NONE
    moved = at(A=70)
    first.written(2, B, moved)
    assert ignored(first, moved, going(moved, B=200)) == B
