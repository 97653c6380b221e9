"""The requests of adopted axes, derived from their statuses."""

from __future__ import annotations

import pytest
from hypothesis import given
from hypothesis import strategies as st

from robotiq_async.control.adoption import DIRECTION_WAIT_S, Adoption
from robotiq_async.control.rest import LAG_READS, LAG_S, Moment
from robotiq_async.values.enums import Finger, Mode, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of

MOVING, OPENING, CLOSING, THERE = ObjectStatus
GO, HALTED = 0x39, 0x31
Four = tuple[int, ...]
SETTINGS = tuple(AxisRequest(0, 10 * n, 20 * n) for n in range(1, 5))


def gripper(
    *what: ObjectStatus,
    byte_0: int = GO,
    echo: Four = (0, 0, 0, 0),
    position: Four = (0, 0, 0, 0),
    at: float = 0.0,
) -> RobotiqStatus:
    """A status with what A, B, C and the scissor do."""
    byte_1 = sum(each << 2 * n for n, each in enumerate(what))
    return status_of(byte_0, byte_1, echo=echo, position=position, at=at)


class Seen:
    """The adoption after some statuses, each asked for when it came."""

    def __init__(self, first: RobotiqStatus) -> None:
        now = Moment(first.timestamp, 0)
        self.adoption = Adoption(now, first, first, now)

    def see(self, status: RobotiqStatus, now: Moment | None = None) -> None:
        now = now or Moment(status.timestamp, self.adoption.now.reads + 1)
        self.adoption = self.adoption._replace(latest=status, now=now)

    @property
    def is_certain(self) -> bool:
        return self.adoption.is_certain


def adopted(*statuses: RobotiqStatus) -> Request:
    """The request that follows from statuses, the first one first."""
    seen = Seen(statuses[0])
    for status in statuses[1:]:
        seen.see(status)
    return seen.adoption.request(SETTINGS)


def positions(request: Request) -> list[int]:
    return [request.position(axis) for axis in THREE_FINGER.axes]


# -- the rules, in their order -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("what", "echo", "position", "expected"),
    [
        # An echo that agrees with what its axis does is the request.
        ((THERE, CLOSING, OPENING, THERE), (100, 220, 30, 255), (99, 150, 60, 241), (100, 220, 30, 255)),
        # B and C echo 0 under simple control, where they follow A; their own echo comes first.
        ((THERE, THERE, THERE, THERE), (180, 0, 0, 0), (179, 181, 180, 137), (180, 180, 180, 137)),
        ((CLOSING, CLOSING, CLOSING, THERE), (255, 200, 210, 0), (150, 150, 150, 0), (255, 200, 210, 0)),
        ((THERE, CLOSING, OPENING, THERE), (100, 0, 255, 0), (100, 150, 60, 6), (100, 255, 0, 0)),
        # The scissor never follows A.
        ((THERE, THERE, THERE, THERE), (137, 0, 0, 0), (137, 137, 137, 137), (137, 137, 137, 137)),
        ((CLOSING, CLOSING, CLOSING, CLOSING), (220, 0, 0, 0), (100, 100, 100, 100), (220, 220, 220, 255)),
        # A contact without a request that agrees stays as it is.
        ((CLOSING, CLOSING, CLOSING, CLOSING), (0, 0, 0, 0), (150, 151, 152, 100), (255, 255, 255, 255)),
        ((OPENING, OPENING, OPENING, OPENING), (255, 255, 255, 255), (150, 151, 152, 100), (0, 0, 0, 0)),
        # A software limit is reported as reached, while the echo keeps the request beyond it.
        ((THERE, THERE, THERE, THERE), (255, 255, 255, 255), (180, 181, 182, 219), (180, 181, 182, 219)),
    ],
)
def test_the_request_of_an_adopted_gripper_at_rest(
    what: tuple[ObjectStatus, ...], echo: Four, position: Four, expected: Four
) -> None:
    assert positions(adopted(gripper(*what, echo=echo, position=position))) == [*expected]


@pytest.mark.parametrize(
    ("what", "echo", "first", "later", "expected"),
    [
        *(
            ((what, what, what, THERE), (220, 0, 0, 0), (100, 101, 99, 137), (105, 106, 104, 137), (220,) * 3)
            for what in (MOVING, CLOSING)
        ),
        # Against every echo: it stays where it is.
        ((THERE, MOVING, THERE, THERE), (0, 0, 0, 0), (6, 100, 6, 6), (6, 110, 6, 6), (0, 110, 0)),
        # The direction of B distinguishes its own echo from that of A.
        *(
            ((MOVING, MOVING, THERE, THERE), (220, 0, 0, 0), (100, 100, 6, 6), (120, b, 6, 6), (220, to, 0))
            for b, to in ((101, 220), (120, 220), (99, 0), (80, 0))
        ),
    ],
)
def test_the_request_of_an_adopted_gripper_in_motion(
    what: tuple[ObjectStatus, ...], echo: Four, first: Four, later: Four, expected: Four
) -> None:
    moved = gripper(*what, echo=echo, position=later, at=DIRECTION_WAIT_S)
    assert positions(adopted(gripper(*what, echo=echo, position=first), moved))[:3] == [*expected]


@pytest.mark.parametrize("what", ObjectStatus)
def test_a_halted_gripper_has_its_own_positions_as_requests(what: ObjectStatus) -> None:
    status = gripper(
        what, what, what, what, byte_0=HALTED, echo=(200, 200, 200, 200), position=(100, 200, 201, 137)
    )
    request = adopted(status)
    assert positions(request) == [100, 200, 201, 137]
    assert not request.go


# -- directions --------------------------------------------------------------------------------------------


def test_nothing_is_certain_before_every_moving_axis_has_shown_its_direction() -> None:
    adoption = Seen(gripper(MOVING, MOVING, THERE, THERE, position=(100, 100, 6, 6)))
    assert not adoption.is_certain
    adoption.see(gripper(MOVING, MOVING, THERE, THERE, position=(101, 100, 6, 6), at=0.01))
    assert not adoption.is_certain
    adoption.see(gripper(MOVING, MOVING, THERE, THERE, position=(101, 99, 6, 6), at=0.02))
    assert adoption.is_certain


def test_an_axis_that_stays_where_it_is_is_not_waited_for_any_longer_than_a_count_takes() -> None:
    adoption = Seen(gripper(MOVING, THERE, THERE, THERE, position=(100, 0, 0, 0), at=5.0))
    adoption.see(gripper(MOVING, THERE, THERE, THERE, position=(100, 0, 0, 0), at=5.0 + DIRECTION_WAIT_S / 2))
    assert not adoption.is_certain
    adoption.see(gripper(MOVING, THERE, THERE, THERE, position=(100, 0, 0, 0), at=5.001 + DIRECTION_WAIT_S))
    assert adoption.is_certain


def test_a_slow_axis_has_the_time_to_show_its_direction() -> None:
    # The slowest full closing takes 10.021 s (thesis, table A1.1) for 235 counts.
    assert DIRECTION_WAIT_S > 2 * 10.021 / 235


@pytest.mark.parametrize("byte_0", [GO, HALTED])
@pytest.mark.parametrize(("what", "echo"), [(OPENING, 0), (CLOSING, 255), (THERE, 100)])
def test_a_gripper_at_rest_is_certain_at_once(byte_0: int, what: ObjectStatus, echo: int) -> None:
    at_rest = gripper(what, what, what, what, byte_0=byte_0, echo=(echo,) * 4, position=(100,) * 4)
    assert Seen(at_rest).is_certain


@pytest.mark.parametrize(("what", "echo"), [(OPENING, 255), (CLOSING, 0), (THERE, 255)])
def test_an_axis_at_rest_that_contradicts_its_echo_may_show_what_was_before_it(
    what: ObjectStatus, echo: int
) -> None:
    """Another client may have opened the hand just before we came: our first write must not close it."""
    shown = gripper(THERE, what, THERE, THERE, echo=(100, echo, 100, 100), position=(100,) * 4)
    adoption = Seen(shown)
    assert not adoption.is_certain
    adoption.see(gripper(THERE, MOVING, THERE, THERE, echo=(100, echo, 100, 100), position=(100,) * 4))
    assert not adoption.is_certain, "its direction is not known yet"
    for reads in range(1, LAG_READS):
        adoption.see(shown, Moment(LAG_S, reads))
        assert not adoption.is_certain
    adoption.see(shown, Moment(LAG_S, LAG_READS))
    assert adoption.is_certain, "it is so, and not late"


def test_a_gripper_with_rgto_clear_is_certain_at_once() -> None:
    assert Seen(status_of(0x31, 0x00)).is_certain


# -- the rest of the image ---------------------------------------------------------------------------------


@pytest.mark.parametrize("mode", Mode)
@pytest.mark.parametrize("byte_0", [GO, HALTED, 0x30])
def test_activation_go_and_mode_are_taken_over_speed_and_force_come_from_the_settings(
    mode: Mode, byte_0: int
) -> None:
    request = adopted(gripper(THERE, THERE, THERE, THERE, byte_0=byte_0 | mode << 1))
    assert request.activate == bool(byte_0 & 0x01)
    assert request.go == bool(byte_0 & 0x08)
    assert request.mode is mode
    assert not request.release
    assert request.individual_fingers
    assert request.individual_scissor
    assert [(axis.speed, axis.force) for axis in request.axes] == [(10, 20), (20, 40), (30, 60), (40, 80)]


# -- any gripper -------------------------------------------------------------------------------------------

BYTES4 = st.tuples(*[st.integers(0, 255)] * 4)
WHATS = st.tuples(*[st.sampled_from(ObjectStatus)] * 4)


@given(WHATS, BYTES4, BYTES4, BYTES4, st.booleans())
def test_an_adopted_gripper_neither_turns_round_nor_lets_go(
    whats: tuple[ObjectStatus, ...],
    echo: Four,
    before: Four,
    now: Four,
    go: bool,
) -> None:
    byte_0 = GO if go else HALTED
    request = adopted(
        gripper(*whats, byte_0=byte_0, echo=echo, position=before),
        gripper(*whats, byte_0=byte_0, echo=echo, position=now, at=DIRECTION_WAIT_S),
    )
    assert request.go == go
    for axis, what, first, position in zip(THREE_FINGER.axes, whats, before, now, strict=True):
        asked = request.position(axis)
        if not go:
            assert asked == position
            continue
        match what:
            case ObjectStatus.CONTACT_CLOSING:
                assert asked > position or asked == 255, "the grip was relaxed"
            case ObjectStatus.CONTACT_OPENING:
                assert asked < position or asked == 0, "the grip was relaxed"
            case ObjectStatus.AT_POSITION:
                within = abs(asked - position) <= 2
                assert within or (asked <= 7 and position <= 9) or (asked >= 240 and position >= 238)
            case ObjectStatus.IN_MOTION:
                assert (asked - position) * (position - first) >= 0, "the axis was turned round"


@given(WHATS, BYTES4, BYTES4)
def test_a_request_is_an_echo_an_end_or_where_the_axis_is(
    whats: tuple[ObjectStatus, ...], echo: Four, position: Four
) -> None:
    request = adopted(gripper(*whats, echo=echo, position=position))
    for number, axis in enumerate(THREE_FINGER.axes):
        possible = {echo[number], position[number], 0, 255}
        if axis in Finger.B | Finger.C:
            possible.add(echo[0])
        assert request.position(axis) in possible


@given(BYTES4, BYTES4)
def test_individual_requests_of_a_holding_gripper_are_kept_as_they_are(position: Four, by: Four) -> None:
    """Under individual control every echo is worth trusting."""
    echo = tuple(min(255, each + 1 + more) for each, more in zip(position, by, strict=True))
    request = adopted(gripper(CLOSING, CLOSING, CLOSING, CLOSING, echo=echo, position=position))
    assert positions(request) == list(echo)
