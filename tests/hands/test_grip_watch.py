"""The fate of grips, from the statuses alone; and the part in a closing, from its result."""

from __future__ import annotations

import struct
from collections import deque
from collections.abc import Iterator

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async import GraspResult, MoveResult
from robotiq_async.hands.grip_watch import SLIP_COUNTS, GripWatch
from robotiq_async.simulator import SimulatedGripper
from robotiq_async.values.enums import Finger, ObjectStatus
from robotiq_async.values.grip import GripChange, GripEvent
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.registers import Registers
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.register_words import status_of, with_object_status

A, B, C, S = THREE_FINGER.axes
GAINED, SLIPPED, LOST, RELEASED = GripChange
MOVING, OPENING, CLOSING, REACHED = ObjectStatus
FAULT = 0x0E
LAGS = (0, 1, 8)


def seen(
    what: ObjectStatus,
    position: int,
    request: int = 255,
    *,
    byte_0: int = 0x39,
    fault: int = 0,
    at: float = 0.0,
) -> RobotiqStatus:
    """A status in which A does something; the others are at their requests."""
    echo, positions = (request, 0, 0, 0), (position, 6, 6, 6)
    return status_of(byte_0, 0xFC | what, fault, echo=echo, position=positions, at=at)


def changes_in(*statuses: RobotiqStatus, watch: GripWatch | None = None) -> list[tuple[GripChange, int]]:
    """The changes in statuses, with the counts that A has moved."""
    watch = watch or GripWatch()
    events = [event for status in statuses for event in watch.see(status)]
    assert all(event.finger is A for event in events)
    return [(event.change, event.moved) for event in events]


# -- each change -------------------------------------------------------------------------------------------


@pytest.mark.parametrize(("contact", "request_"), [(CLOSING, 255), (OPENING, 0)])
def test_a_contact_is_gained(contact: ObjectStatus, request_: int) -> None:
    watch = GripWatch()
    before, after = seen(MOVING, 100, request_), seen(contact, 150, request_)
    assert changes_in(before, after, after, watch=watch) == [(GAINED, 0)]
    assert watch.holds == A


def test_the_contacts_of_the_first_status_are_where_it_begins() -> None:
    watch = GripWatch()
    assert changes_in(seen(CLOSING, 150), seen(CLOSING, 150), watch=watch) == []
    assert watch.holds == A
    assert changes_in(seen(REACHED, 241), watch=watch) == [(LOST, 91)]


@pytest.mark.parametrize("moved", range(-6, 7))
def test_an_axis_that_moves_in_contact_slips(moved: int) -> None:
    slips = abs(moved) > SLIP_COUNTS
    assert changes_in(seen(CLOSING, 150), seen(CLOSING, 150 + moved)) == [(SLIPPED, moved)] * slips


def test_how_far_it_may_move_can_be_said() -> None:
    assert changes_in(seen(CLOSING, 150), seen(CLOSING, 152), watch=GripWatch(slip=1)) == [(SLIPPED, 2)]
    assert changes_in(seen(CLOSING, 150), seen(CLOSING, 160), watch=GripWatch(slip=10)) == []


def test_an_axis_that_tries_again_and_gets_nowhere_has_kept_its_grip() -> None:
    watch = GripWatch()
    again = [seen(MOVING, 150), seen(MOVING, 152), seen(CLOSING, 152)]
    assert changes_in(seen(CLOSING, 150), *again, watch=watch) == []
    assert watch.holds == A


def test_an_axis_that_tries_again_and_gets_further_has_slipped() -> None:
    watch = GripWatch()
    on_its_way = [seen(MOVING, position) for position in (150, 153, 160, 170)]
    assert changes_in(seen(CLOSING, 150), *on_its_way, watch=watch) == [(SLIPPED, 10)]
    assert watch.holds == Finger(0), "until the gripper says so again"
    assert changes_in(seen(CLOSING, 172), watch=watch) == [(GAINED, 0)]
    assert changes_in(seen(CLOSING, 174), seen(CLOSING, 176), watch=watch) == [(SLIPPED, 4)]


HELD, SHORT, INSIDE = seen(CLOSING, 150), seen(CLOSING, 150, 200), seen(OPENING, 60, 0)
NO_ECHO = seen(CLOSING, 150, 0)
"""Under simple control A's registers drive all fingers; the echoes of the others stay what they were."""
OPENS_LATE = [seen(CLOSING, position, 0) for position in (150, 147, 145, 141)]
"""The object status may trail the echo and the position by some reads."""


@pytest.mark.parametrize(
    ("statuses", "changes"),
    [
        # It creeps.
        ([seen(CLOSING, position) for position in range(150, 159)], [(SLIPPED, 4), (SLIPPED, 4)]),
        # It closes on to its end, also when no status has the motion.
        ([HELD, seen(MOVING, 160), seen(REACHED, 241)], [(SLIPPED, 10), (LOST, 81)]),
        ([HELD, seen(REACHED, 241)], [(LOST, 91)]),
        ([SHORT, seen(MOVING, 160, 200), seen(REACHED, 200, 200)], [(SLIPPED, 10), (LOST, 40)]),
        ([SHORT, seen(REACHED, 200, 200)], [(LOST, 50)]),
        # A request releases it: the event comes when the contact ends.
        ([HELD, seen(MOVING, 149, 0)], [(RELEASED, -1)]),
        ([HELD, seen(REACHED, 6, 0)], [(RELEASED, -144)]),
        ([HELD, seen(REACHED, 150, 150)], [(RELEASED, 0)]),
        ([HELD, seen(CLOSING, 150, 0)], []),
        # A grip from inside is held by opening and released by closing.
        ([INSIDE, seen(REACHED, 6, 0)], [(LOST, -54)]),
        ([INSIDE, seen(MOVING, 70, 255)], [(RELEASED, 10)]),
        ([INSIDE, seen(MOVING, 50, 0), seen(OPENING, 50, 0)], [(SLIPPED, -10), (GAINED, 0)]),
        # The other contact is another grip.
        ([HELD, seen(OPENING, 100, 0)], [(RELEASED, -50), (GAINED, 0)]),
        ([HELD, seen(OPENING, 100)], [(LOST, -50), (GAINED, 0)]),
        # What is not known to be held is lost.
        ([HELD, seen(MOVING, 150, byte_0=0x00)], [(LOST, 0)]),  # reset, or without power
        ([HELD, seen(CLOSING, 150, byte_0=0x09)], [(LOST, 0)]),  # an automatic release
        ([HELD, seen(MOVING, 150, byte_0=0x31)], [(LOST, 0)]),  # a halt after which no contact is reported
        ([HELD, seen(MOVING, 150, fault=FAULT)], [(LOST, 0)]),
        ([HELD, seen(MOVING, 150, 0, byte_0=0x09)], [(LOST, 0)]),  # the same three under another request
        ([HELD, seen(MOVING, 150, 0, byte_0=0x31)], [(LOST, 0)]),
        ([HELD, seen(MOVING, 150, 0, fault=FAULT)], [(LOST, 0)]),
        # A contact that is still reported after a halt or in a fault is one.
        ([HELD, seen(CLOSING, 150, byte_0=0x31), seen(CLOSING, 150, fault=FAULT)], []),
        # Without an echo nothing counts as a request; from the first echo on that presses it does.
        ([NO_ECHO, seen(REACHED, 241, 0)], [(LOST, 91)]),
        ([NO_ECHO, seen(MOVING, 150, 0)], [(LOST, 0)]),
        ([NO_ECHO, HELD, seen(MOVING, 149, 0)], [(RELEASED, -1)]),
        # An axis that opens before its contact ends has not slipped, also where the watch begins in between.
        ([HELD, *OPENS_LATE, seen(MOVING, 139, 0)], [(RELEASED, -11)]),
        ([*OPENS_LATE[:2], seen(MOVING, 145, 0)], [(RELEASED, -5)]),
        # A late status is passed over; one of another clock, as from before a restart, is believed.
        ([seen(CLOSING, 150, at=2.0), seen(REACHED, 100, 100, at=1.5), seen(CLOSING, 150, at=3.0)], []),
        ([seen(CLOSING, 150, at=5000.0), seen(REACHED, 241, at=7.0)], [(LOST, 91)]),
    ],
)
def test_statuses_tell(statuses: list[RobotiqStatus], changes: list[tuple[GripChange, int]]) -> None:
    assert changes_in(*statuses) == changes


def test_it_may_begin_with_a_status_from_before() -> None:
    watch = GripWatch(since=seen(CLOSING, 150))
    assert watch.holds == A
    assert changes_in(seen(REACHED, 241), watch=watch) == [(LOST, 91)]
    assert changes_in(seen(CLOSING, 150), watch=GripWatch(since=seen(REACHED, 6, 6))) == [(GAINED, 0)]


def test_only_the_axes_that_are_watched_tell() -> None:
    nothing, all_hold = status_of(0x39, 0x00, echo=255), status_of(0x39, 0xAA, echo=255, position=150)
    for fingers in (A, B | C, Finger.ABC, Finger.ALL):
        watch = GripWatch(fingers)
        assert watch.see(nothing) == []
        events = watch.see(all_hold)
        assert [event.finger for event in events] == list(fingers)
        assert {event.holds for event in events} == {fingers}


def test_an_event_says_where_and_when() -> None:
    watch = GripWatch()
    watch.see(seen(CLOSING, 150, at=1.0))
    (event,) = watch.see(seen(CLOSING, 158, at=2.5))
    assert (event.position, event.timestamp, event.status.sequence) == (158, 2.5, 0)
    assert repr(event) == "<GripEvent A SLIPPED by +8 at 158; contact of A>"


@pytest.mark.parametrize("bad", [0, 256, -1])
def test_a_slip_that_is_none_is_refused(bad: int) -> None:
    with pytest.raises(ValueError, match=rf"slip must be in 1\.\.255, got {bad}"):
        GripWatch(slip=bad)


# -- whatever comes ----------------------------------------------------------------------------------------

MADE = [
    seen(what, position, request, byte_0=byte_0, fault=fault)
    for what in ObjectStatus
    for position in (0, 6, 60, 96, 100, 101, 105, 150, 154, 158, 241, 255)
    for request in (0, 100, 200, 255)
    for byte_0, fault in ((0x39, 0), (0x39, 0), (0x31, 0), (0x11, 0), (0x00, 0), (0x39, 0x05), (0x39, FAULT))
]
STATUSES = st.lists(st.sampled_from(MADE), max_size=30)
HALF = settings(max_examples=settings().max_examples // 2)
"""Enough for lists of thirty: each tries a thousand pairs of statuses."""


def reports_contact(status: RobotiqStatus) -> bool:
    return status.is_activated and status.finger_status(A).is_contact


@HALF
@given(STATUSES)
def test_an_axis_in_contact_holds_and_one_at_rest_without_contact_does_not(
    statuses: list[RobotiqStatus],
) -> None:
    watch = GripWatch(A)
    for status in statuses:
        watch.see(status)
        assert bool(watch.holds) == reports_contact(status) or (
            watch.holds == A and A in status.moving and not status.fault.is_serious
        )


@HALF
@given(STATUSES)
def test_the_events_alone_say_which_axes_hold(statuses: list[RobotiqStatus]) -> None:
    watch, holds, is_slipping = GripWatch(A), False, False
    for status in [seen(REACHED, 6, 0), *statuses]:
        for event in watch.see(status):
            if event.change is GAINED:
                assert not holds
            else:
                assert holds or (is_slipping and event.change is not SLIPPED)
            is_slipping = event.change is SLIPPED and not reports_contact(status)
            holds = event.change is GAINED or (event.change is SLIPPED and not is_slipping)
        assert bool(watch.holds) == holds


@HALF
@given(STATUSES)
def test_the_same_status_again_tells_nothing_new(statuses: list[RobotiqStatus]) -> None:
    watch = GripWatch(A)
    for status in statuses:
        watch.see(status)
        assert watch.see(status) == []


@given(st.lists(st.binary(min_size=16, max_size=16), max_size=8))
def test_no_reading_is_too_much_for_it(readings: list[bytes]) -> None:
    """It works in the turn of the poll: what it raised would end that."""
    watch = GripWatch(Finger.ALL, slip=1)
    for reading in readings:
        status = RobotiqStatus.from_registers(struct.unpack(">8H", reading))
        assert all(event.status is status for event in watch.see(status))
        assert watch.holds in Finger.ALL


@HALF
@given(STATUSES, st.integers(0, 30))
def test_a_watch_that_misses_statuses_ends_with_the_same_grips(
    statuses: list[RobotiqStatus], missed: int
) -> None:
    patient, slow = GripWatch(A), GripWatch(A)
    end = seen(CLOSING, 150) if missed % 2 else seen(REACHED, 241)
    for status in [*statuses, end]:
        patient.see(status)
    for status in [*statuses[missed:], end]:
        slow.see(status)
    assert patient.holds == slow.holds


# -- on a gripper ------------------------------------------------------------------------------------------


class Cell:
    """A simulated gripper that is looked at every 5 ms, its gDT some reads late, and a watch."""

    def __init__(self, lag: int = 0) -> None:
        self.now = 0.0
        self.late: deque[Registers] = deque(maxlen=lag + 1)
        self.gripper = SimulatedGripper(lambda: self.now, spread=False)
        self.watch = GripWatch()
        self._write(0, 64, go=False)
        self.now += 10
        for _ in self.statuses(0.1):
            pass

    def ask(self, position: int, force: int = 64, seconds: float = 2.5) -> list[GripEvent]:
        """The events after a request."""
        self._write(position, force)
        return [event for status in self.statuses(seconds) for event in self.watch.see(status)]

    def statuses(self, seconds: float) -> Iterator[RobotiqStatus]:
        for _ in range(round(seconds / 0.005)):
            self.now += 0.005
            self.late.append(self.gripper.status_registers())
            yield RobotiqStatus(with_object_status(self.late[-1], self.late[0]), self.now)

    def _write(self, position: int, force: int, *, go: bool = True) -> None:
        axes = (AxisRequest(position, 255, force),) * 3 + (AxisRequest(137, 255, 64),)
        self.gripper.write(0, Request(activate=True, go=go, axes=axes).registers)


def changes(events: list[GripEvent]) -> list[tuple[GripChange, Finger]]:
    return [(event.change, event.finger) for event in events]


@pytest.mark.parametrize("lag", LAGS)
def test_a_part_is_grasped_tightened_and_let_go(lag: int) -> None:
    cell = Cell(lag)
    cell.gripper.place_object(Finger.ABC, 150)
    assert changes(cell.ask(255)) == [(GAINED, A), (GAINED, B), (GAINED, C)]
    assert cell.ask(255, force=200) == [], "they press again, and get nowhere"
    assert changes(cell.ask(0)) == [(RELEASED, A), (RELEASED, B), (RELEASED, C)]


@pytest.mark.parametrize("lag", LAGS)
def test_a_part_that_gives_way_slips_through(lag: int) -> None:
    cell = Cell(lag)
    cell.gripper.place_object(A, 150)
    cell.ask(255)
    cell.gripper.remove_object(A)
    events = cell.ask(255, force=200)
    assert list(dict.fromkeys(changes(events))) == [(SLIPPED, A), (LOST, A)], "in one slip or, late, in two"
    assert sum(event.moved for event in events) == 241 - 150


def test_something_soft_that_is_pressed_deeper_slips() -> None:
    cell = Cell()
    cell.gripper.place_object(A, 150, soft=40)
    cell.ask(255, force=50)
    assert changes(cell.ask(255, force=255)) == [(SLIPPED, A), (GAINED, A)]


# -- the result of a grasp ---------------------------------------------------------------------------------


def grasp(at_least: int, **outcomes: ObjectStatus) -> GraspResult:
    ends = {Finger[name]: how for name, how in outcomes.items()}
    contacts = Finger(sum(axis for axis, how in ends.items() if how.is_contact))
    peaks = dict.fromkeys(ends, 0)
    move = MoveResult(ends, dict.fromkeys(ends, 150), contacts, Finger(0), 1.0, peaks, status_of(0xB9))
    return GraspResult(move, at_least)


@pytest.mark.parametrize(
    ("outcomes", "holds"),
    [
        ({"A": CLOSING, "B": CLOSING, "C": CLOSING}, A | B | C),
        ({"A": CLOSING, "B": REACHED, "C": CLOSING}, A | C),
        ({"A": OPENING, "B": CLOSING, "C": REACHED}, B),
        ({"A": REACHED, "B": REACHED, "C": REACHED}, Finger(0)),
    ],
)
def test_axes_stopped_by_a_contact_while_closing_hold(
    outcomes: dict[str, ObjectStatus], holds: Finger
) -> None:
    for at_least in (1, 2, 3):
        result = grasp(at_least, **outcomes)
        assert result.holds == holds
        assert result.is_held == bool(result) == (holds.bit_count() >= at_least)


def test_the_repr_of_a_grasp_result() -> None:
    assert repr(grasp(1, A=CLOSING, B=REACHED)) == (
        "<GraspResult held: contact of A, 1 needed; A=150, B=150>"
    )
    assert repr(grasp(2, A=REACHED, B=REACHED)) == (
        "<GraspResult not held: contact of none, 2 needed; A=150, B=150>"
    )
