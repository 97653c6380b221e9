"""The image that a status echoes, the time at which it acts, images of other clients, and axes at rest."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.control.adoption import DIRECTION_WAIT_S
from robotiq_async.control.entry import Entry
from robotiq_async.control.ledger import SILENT_S, WINDOW_S, Ledger
from robotiq_async.control.rest import LAG_READS, LAG_S
from robotiq_async.values.enums import NO_AXES, Finger, ObjectStatus
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import EPSILON, image, shows
from tests.control.scan import first_request
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes


class History(Ledger):
    """The history of a gripper that reports a position at first; it answers and acknowledges at once."""

    def __init__(self, position: int = 0) -> None:
        super().__init__(first_request(100, 50))
        self.written: list[Entry] = []
        self.look(shows(position, 0.0))
        self.adopt(self.latest)
        self.restart(self.latest)

    def look(self, status: RobotiqStatus, asked: float | None = None) -> Entry | None:
        """Take in a status; return the entry that it echoes."""
        self.latest = status
        self.update(status, status.timestamp if asked is None else asked)
        return self.match

    def send(self, request: Request, at: float, moved: Finger = NO_AXES) -> Entry:
        entry = self.write(request, moved, at)
        self.written.append(entry)
        return entry

    def deliver(self, request: Request, at: float, moved: Finger = NO_AXES) -> Entry:
        entry = self.send(request, at, moved)
        self.acknowledge(at)
        return entry

    @property
    def unanswered(self) -> list[Entry]:
        """The images written that do not act yet."""
        return [each for each in self.written if not self.acts(each)]


# -- what happens one after another ------------------------------------------------------------------------

Event = Callable[[History, float], object]


def writes(position: int, **options: Any) -> Event:
    return lambda history, at: history.deliver(image(position, **options), at)


def sends(position: int) -> Event:
    """A write that is not acknowledged yet."""
    return lambda history, at: history.send(image(position), at)


def acknowledged(history: History, at: float) -> None:
    history.acknowledge(at)


def link_lost(history: History, _: float) -> None:
    history.lost()


def time_passes(history: History, at: float) -> None:
    """Take in nothing but the status of before."""
    history.look(shows(history.latest.requested_position(A), at, go=history.latest.go_echo))


def ours(position: int, *, go: bool = True, **options: Any) -> Event:
    """An event: a status that echoes an image of ours."""

    def look(history: History, at: float) -> None:
        entry = history.look(shows(position, at, go=go))
        assert entry is not None, at
        assert entry.image == image(position, go=go, **options), at

    return look


def foreign(position: int) -> Event:
    """An event: a status that echoes an image of another client."""

    def look(history: History, at: float) -> None:
        assert history.look(shows(position, at)) is None, at

    return look


def adopts(position: int) -> Event:
    return lambda history, at: history.adopt(shows(position, at))


def restarts(position: int) -> Event:
    return lambda history, at: history.restart(shows(position, at))


class At(NamedTuple):
    """Event at a time, number of the last images that do not act yet, and whether one may never act."""

    time: float
    event: Event
    waiting: int = 0
    in_doubt: bool = False


LOST = [At(1.0, sends(200), 1), At(1.0, link_lost, 1, in_doubt=True)]
STORIES: dict[str, tuple[int, list[At]]] = {
    "what shows at the start": (30, [At(0.0, ours(30))]),
    # One write acts when its echo is seen, or some time after its acknowledgement.
    "an echo": (0, [At(1.0, writes(100), 1), At(1.005, ours(0), 1), At(1.01, ours(100))]),
    "an echo before the acknowledgement": (0, [At(1.0, sends(100), 1), At(1.005, ours(100))]),
    "no acknowledgement": (0, [At(1.0, sends(100), 1), At(100.0, time_passes, 1), At(101.0, ours(100))]),
    "no echo": (
        0,
        [
            At(1.0, writes(100), 1),
            At(1.0 + WINDOW_S - EPSILON, time_passes, 1),
            At(1.0 + WINDOW_S, time_passes),
        ],
    ),
    "no echo after a late acknowledgement": (
        0,
        [
            *(At(1.0, sends(100), 1), At(1.3, acknowledged, 1)),
            *(At(1.3 + WINDOW_S - EPSILON, time_passes, 1), At(1.3 + WINDOW_S, time_passes)),
        ],
    ),
    "a cleared rGTO": (
        0,
        [At(1.0, writes(0, go=False), 1), At(1.005, ours(0), 1), At(1.01, ours(0, go=False))],
    ),
    # Several writes act in their order.
    "there and back": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.01, writes(100), 2)),
            *(At(1.015, ours(100), 2), At(1.02, ours(200), 1), At(1.025, ours(100))),
        ],
    ),
    "there and back from elsewhere": (
        0,
        [
            *(
                At(1.0, writes(100), 1),
                At(1.01, writes(200), 2),
                At(1.02, writes(100), 3),
                At(1.04, ours(0), 3),
            ),
            *(At(1.05, ours(100), 2), At(1.06, ours(100), 2), At(1.07, ours(200), 1), At(1.08, ours(100))),
        ],
    ),
    "there and back that never shows": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.01, writes(100), 2)),
            *(At(1.0 + WINDOW_S - EPSILON, ours(100), 2), At(1.01 + WINDOW_S, time_passes)),
        ],
    ),
    "a slow gripper shows the image before the last": (
        0,
        [
            *(At(1.0, writes(10), 1), At(1.1, writes(20), 2), At(1.2, writes(30), 3)),
            *(At(1.21, ours(10), 2), At(1.22, ours(10), 2), At(1.31, ours(20), 1), At(1.41, ours(30))),
        ],
    ),
    "a gripper skips an image": (
        0,
        [At(1.0, writes(10), 1), At(1.01, writes(20), 2), At(1.02, ours(0), 2), At(1.03, ours(20))],
    ),
    # Speed and force have no echo.
    "a speed": (
        0,
        [
            *(At(1.0, writes(0, speed=200), 1), At(1.005, ours(0), 1)),
            *(At(1.0 + SILENT_S - EPSILON, time_passes, 1), At(1.0 + SILENT_S, time_passes)),
        ],
    ),
    "a force": (
        0,
        [
            *(At(1.0, writes(0, force=200), 1), At(1.005, ours(0), 1)),
            *(At(1.0 + SILENT_S - EPSILON, time_passes, 1), At(1.0 + SILENT_S, time_passes)),
        ],
    ),
    "an identical image": (0, [At(1.0, writes(0))]),
    "a speed behind a position waits for it": (
        0,
        [
            *(At(1.0, writes(100), 1), At(1.01, writes(100, speed=200), 2)),
            *(At(1.01 + SILENT_S, time_passes, 2), At(1.02 + SILENT_S, ours(100))),
        ],
    ),
    "a speed right behind a position has its time after the echo": (
        0,
        [
            *(At(1.0, writes(100), 1), At(1.001, writes(100, speed=200), 2)),
            *(At(1.01, ours(100), 1), At(1.001 + SILENT_S, time_passes)),
        ],
    ),
    "a position behind a speed shows that both act": (
        0,
        [
            *(At(1.0, writes(0, speed=200), 1), At(1.01, writes(100, speed=200), 2)),
            At(1.02, ours(100, speed=200)),
        ],
    ),
    # Another client's image is foreign until it is adopted, an older one of ours after the window.
    "another client": (
        0,
        [At(1.0, foreign(77)), At(1.1, foreign(77)), At(1.1, adopts(77)), At(1.2, ours(77))],
    ),
    "another client that undoes a write before it shows": (
        100,
        [At(1.0, writes(200), 1), At(1.005, ours(100), 1), At(1.0 + WINDOW_S + EPSILON, foreign(100))],
    ),
    "the image before the last comes back": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.01, ours(200))),
            *(At(1.5 - EPSILON, ours(100)), At(1.0 + WINDOW_S, foreign(100)), At(1e6, ours(200))),
        ],
    ),
    "of older images the newest before the window is kept": (
        0,
        [
            *(At(1.0, writes(10), 1), At(2.0, writes(20), 2), At(2.4, writes(30), 3), At(2.41, ours(30))),
            *(At(2.6, ours(20)), At(2.6, foreign(10))),
        ],
    ),
    "what had shown before an adoption": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.01, ours(200)), At(1.02, adopts(77))),
            *(At(1.03, foreign(100)), At(1.03, foreign(200))),
        ],
    ),
    "what was written before a restart": (
        100,
        [
            *(At(1.0, sends(200), 1), At(1.1, restarts(50))),
            *(At(1.12, foreign(200)), At(1.13, foreign(100))),
        ],
    ),
    "a write that another client's overtook may still act": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.01, foreign(77), 1), At(1.01, adopts(77), 1, in_doubt=True)),
            At(1.02, ours(200)),
        ],
    ),
    # A write that was lost with the link is in doubt until its echo, or as long as the window.
    "an acknowledged write that has not shown is in doubt, too": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.0, link_lost, 1, in_doubt=True)),
            *(At(1.1, ours(100), 1, in_doubt=True), At(1.15, ours(200))),
        ],
    ),
    "an acknowledged write that shows on no new link": (
        100,
        [
            *(At(1.0, writes(200), 1), At(1.4, link_lost, 1, in_doubt=True)),
            *(At(1.4, ours(100), 1, in_doubt=True), At(1.0 + WINDOW_S + EPSILON, ours(100))),
            At(1.6, foreign(200)),
        ],
    ),
    "an acknowledged force remains": (100, [At(1.0, writes(100, force=200), 1), At(1.0, link_lost, 1)]),
    "a lost write had arrived": (100, [*LOST, At(1.0 + WINDOW_S, ours(200))]),
    "a lost write arrives": (
        100,
        [
            *(
                *LOST,
                At(1.1, ours(100), 1, True),
                At(1.1, adopts(100), 1, True),
                At(1.12, ours(100), 1, True),
            ),
            At(1.15, ours(200)),
        ],
    ),
    "a lost write does not arrive": (
        100,
        [
            *(*LOST, At(1.1, adopts(100), 1, True), At(1.0 + WINDOW_S - EPSILON, time_passes, 1, True)),
            *(At(1.0 + WINDOW_S + EPSILON, ours(100)), At(1.6, foreign(200))),
        ],
    ),
}


@pytest.mark.parametrize("name", STORIES)
def test_a_history_of_writes(name: str) -> None:
    position, story = STORIES[name]
    history = History(position)
    for at, event, waiting, in_doubt in story:
        event(history, at)
        assert history.unanswered == history.written[len(history.written) - waiting :], at
        assert any(each.is_doubtful for each in history.unanswered) == in_doubt, at


@pytest.mark.parametrize(
    "status",
    [
        shows(77, 1.0),
        shows(0, 1.0, go=False),
        status_of(0x38, echo=0, at=1.0),
        status_of(0x39, echo=(0, 0, 0, 1), at=1.0),
    ],
    ids=["positions", "go", "activation", "one axis"],
)
def test_an_echo_that_was_never_written_is_foreign(status: RobotiqStatus) -> None:
    history = History()
    history.deliver(image(50), 0.9)
    assert history.look(status) is None


def remembered(history: History) -> int:
    """The number of entries that are kept, or of requests of an axis if these are more."""
    by_axis = map(len, history.requests.targets.values())
    return max(len(history._past) + len(history.ahead), *by_axis, 0)


def test_a_long_life_does_not_make_the_history_remember_more() -> None:
    history = History()
    for n in range(2000):
        entry = history.deliver(image(n % 256), n / 10)
        shown = history.look(shows(n % 256, n / 10 + 0.01))
        assert shown is not None
        assert shown.image == entry.image
        history.update_rest(history.latest)
    assert remembered(history) <= WINDOW_S * 10 + 2 + LAG_READS


def test_settings_of_fingers_at_rest_are_not_remembered_for_ever() -> None:
    """A control loop that sends speeds alone: no axis has an object status that could be late."""
    history = History(100)
    for n in range(2000):
        history.deliver(image(100, speed=n % 256), n / 200)
        history.look(shows(100, n / 200 + EPSILON))
        history.update_rest(history.latest)
    assert remembered(history) <= WINDOW_S * 200 + 2


def test_a_status_of_another_image_is_not_taken_for_the_adopted_one() -> None:
    ledger, adopted = Ledger(first_request()), status_of(0x39, 0xFF, echo=80, position=80)
    ledger.update(adopted, 0.0)
    ledger.adopt(adopted)
    before = ledger.base
    ledger.update(status_of(0x39, 0xFF, echo=90, position=90), 1.0)
    assert ledger.match is None
    assert ledger.base == before


def test_an_adopted_image_may_differ_from_its_echo() -> None:
    """Simple control: B, C and the scissor echo 0 and have other requests."""
    ledger = Ledger(first_request(100, 50))
    status = status_of(0x39, 0xFF, echo=(80, 0, 0, 0), position=(80, 80, 80, 60))
    ledger.update(status, 0.0)
    assert ledger.match is None
    ledger.adopt(status)
    ledger.update(status, 0.1)
    assert ledger.match is not None
    assert [asked.position for asked in ledger.base.axes] == [80, 80, 80, 60]


def test_an_old_status_that_is_looked_at_late_is_compared_with_what_was_written_then() -> None:
    """It is as old as its request, however late the reply was looked at."""
    history = History(100)
    entry = history.deliver(image(200), 1.0)
    shown = history.look(shows(100, 1.7), 1.0)
    assert shown is not None
    assert shown.image == image(100)
    assert not history.acts(entry)


def test_a_lost_write_that_shows_after_a_long_outage_is_ours() -> None:
    """Nothing else was written since: the gripper has it."""
    history = History(100)
    entry = history.send(image(200), 1.0, A)
    history.lost()
    assert history.look(shows(200, 60.0)) is entry
    assert history.base == image(200)


def test_after_a_silence_no_echo_of_long_ago_is_ours() -> None:
    history = History(100)
    history.deliver(image(200), 1.0)
    history.look(shows(200, 1.01))
    assert history.look(shows(100, 60.0)) is None


def test_what_another_thread_reads_of_what_is_ahead_does_not_change_under_it() -> None:
    history = History(100)
    history.deliver(image(200), 1.0)
    read = history.ahead
    first = [*read]
    history.deliver(image(150), 1.1)
    assert [*read] == first
    history.look(shows(150, 1.2))
    assert [*read] == first


# -- images that cannot be distinguished -------------------------------------------------------------------


@pytest.mark.parametrize("arrives", [True, False])
def test_of_images_that_show_alike_the_newest_that_has_arrived_is_the_one_in_force(arrives: bool) -> None:
    """The speed and force of one that may not have arrived have no echo that could decide."""
    history = History(100)
    history.send(image(100, speed=7), 1.0)
    if arrives:
        history.acknowledge(1.0)
    else:
        history.lost()
    assert history.look(shows(100, 1.01)) is not None
    assert history.base == (image(100, speed=7) if arrives else image(100))


# -- what the next image is made from ----------------------------------------------------------------------


def test_before_anything_is_known_every_axis_has_the_settings_of_the_hand() -> None:
    assert Ledger(first_request()).base == Request(axes=(AxisRequest(0, 128, 64),) * 4)


def found(status: RobotiqStatus) -> Ledger:
    """The ledger of a gripper that another client has commanded, and that the hand has found."""
    ledger = Ledger(first_request(100, 50))
    ledger.update(status, status.timestamp)
    ledger.adopt(status)
    return ledger


@pytest.mark.parametrize("status", [shows(100, 1.0), status_of(0x00, at=1.0)], ids=["active", "reset"])
def test_the_first_image_shown_is_not_ours_but_settled(status: RobotiqStatus) -> None:
    ledger = found(status)
    assert ledger.ours == NO_AXES
    assert ledger.requests.unrested == NO_AXES
    assert not ledger.may_begin_to_move
    assert ledger.is_settled
    assert ledger.is_certain


def sent_from_rest(
    to: int = 200, *, is_lost: bool = False
) -> tuple[Ledger, Callable[[int, int, ObjectStatus, float], RobotiqStatus]]:
    """The ledger of a gripper whose A was at rest at 100, and what makes and takes in its statuses."""
    ledger = found(shows(100, 0.0))

    def shown(echo: int, position: int, what: ObjectStatus, at: float) -> RobotiqStatus:
        at_rest = (100, 100, 100)
        echoes, positions = (echo, *at_rest), (position, *at_rest)
        status = status_of(0x39, 0xFC | what, echo=echoes, position=positions, at=at)
        ledger.update(status, at)
        return status

    for n in range(100):
        ledger.update_rest(shown(100, 100, ObjectStatus.AT_POSITION, n / 200))
    ledger.write(ledger.base.with_positions({A: to}), A, 0.5)
    if is_lost:
        ledger.lost(0.5)
    else:
        ledger.acknowledge(0.5)
    return ledger, shown


def test_a_late_contact_of_another_clients_request_is_no_rest_under_ours() -> None:
    """Ours was in doubt, and shows after all: what moved the axis in between is not known."""
    ledger, shown = sent_from_rest()
    ledger.adopt(shown(60, 100, ObjectStatus.AT_POSITION, 0.505))
    shown(200, 98, ObjectStatus.AT_POSITION, 0.51)
    assert ledger.base.position(A) == 200
    ledger.update_rest(shown(200, 92, ObjectStatus.IN_MOTION, 0.515))
    ledger.update_rest(shown(200, 90, ObjectStatus.CONTACT_OPENING, 0.52))
    assert A in ledger.requests.unrested
    assert ledger.may_begin_to_move


def test_a_motion_by_another_client_is_no_start_of_our_write_in_doubt() -> None:
    """Ours shows after it. The contact that comes then may be one of the other client's motion."""
    ledger, shown = sent_from_rest()
    ledger.adopt(moving := shown(60, 98, ObjectStatus.IN_MOTION, 0.505))
    ledger.update_rest(moving)
    ledger.update_rest(shown(200, 92, ObjectStatus.IN_MOTION, 0.51))
    ledger.update_rest(shown(200, 90, ObjectStatus.CONTACT_OPENING, 0.515))
    assert A in ledger.requests.unrested
    assert ledger.may_begin_to_move


def test_a_motion_before_our_write_shows_proves_nothing_once_another_client_has_overtaken_it() -> None:
    ledger, shown = sent_from_rest()
    ledger.update_rest(shown(100, 102, ObjectStatus.IN_MOTION, 0.505))
    ledger.adopt(shown(60, 104, ObjectStatus.IN_MOTION, 0.51))
    ledger.update_rest(shown(60, 104, ObjectStatus.CONTACT_CLOSING, 0.515))
    assert A in ledger.requests.unrested


def test_an_axis_rests_although_a_write_was_lost_that_never_arrives() -> None:
    ledger, shown = sent_from_rest(is_lost=True)
    ledger.update_rest(shown(100, 100, ObjectStatus.AT_POSITION, 0.505))
    assert A not in ledger.requests.unrested
    assert ledger.may_begin_to_move, "the write may act"
    shown(100, 100, ObjectStatus.AT_POSITION, 0.51 + WINDOW_S)
    assert not ledger.may_begin_to_move


def test_a_motion_after_a_lost_write_may_be_the_one_of_that() -> None:
    """So the contact that follows is no rest under what was written since."""
    ledger, shown = sent_from_rest(60, is_lost=True)
    shown(100, 100, ObjectStatus.AT_POSITION, 0.8)
    ledger.write(ledger.base.with_positions({A: 200}), A, 0.8)
    ledger.acknowledge(0.8)
    ledger.update_rest(shown(200, 92, ObjectStatus.IN_MOTION, 0.805))
    ledger.update_rest(shown(200, 90, ObjectStatus.CONTACT_OPENING, 0.81))
    assert A in ledger.requests.unrested


def test_a_lost_write_that_shows_late_acts_before_what_was_written_since() -> None:
    ledger, shown = sent_from_rest(is_lost=True)
    shown(100, 100, ObjectStatus.AT_POSITION, 0.8)
    ledger.write(image := ledger.base.with_positions({A: 150}), A, 0.8)
    ledger.acknowledge(0.8)
    ledger.update_rest(shown(200, 110, ObjectStatus.IN_MOTION, 0.805))
    assert ledger.base == image
    assert not ledger.is_settled
    ledger.update_rest(shown(150, 150, ObjectStatus.AT_POSITION, 0.9))
    assert ledger.is_settled
    assert A not in ledger.requests.unrested


def test_a_lost_write_does_not_show_once_a_later_one_acts() -> None:
    ledger, shown = sent_from_rest(is_lost=True)
    shown(100, 100, ObjectStatus.AT_POSITION, 0.8)
    ledger.write(ledger.base.with_positions({A: 150}), A, 0.8)
    ledger.acknowledge(0.8)
    shown(200, 110, ObjectStatus.IN_MOTION, 0.81 + WINDOW_S)
    assert ledger.match is None, "another client's"


def test_a_write_that_never_shows_delays_no_axis_longer_than_it_may_show() -> None:
    """The gripper has forgotten it: what shows then counts as another client's."""
    ledger, shown = sent_from_rest()
    for n in range(LAG_READS):
        ledger.update_rest(shown(100, 100, ObjectStatus.AT_POSITION, 0.5 + n / 100))
    assert A in ledger.requests.unrested
    status = shown(100, 100, ObjectStatus.AT_POSITION, 0.5 + WINDOW_S)
    assert ledger.match is None
    ledger.adopt(status)
    ledger.update_rest(status)
    assert A not in ledger.requests.unrested


def test_a_moving_gripper_that_is_found_is_not_certain_before_it_has_shown_its_direction() -> None:
    ledger = found(moving := status_of(0x39, 0x00, echo=100, position=50, at=1.0))
    assert not ledger.is_certain
    ledger.update(moving, 1.0 + DIRECTION_WAIT_S)
    assert ledger.is_certain


def test_a_write_is_what_the_next_is_made_from_and_acts_once_it_shows() -> None:
    ledger = found(shows(100, 1.0))
    entry = ledger.write(image(200), Finger.ALL, 1.0)
    ledger.acknowledge(1.0)
    assert ledger.base == image(200)
    assert ledger.ours == Finger.ALL
    ledger.update(shows(100, 1.01), 1.01)
    assert not ledger.acts(entry)
    assert ledger.may_begin_to_move
    ledger.update(status := shows(200, 1.02), 1.02)
    assert ledger.acts(entry)
    assert ledger.may_begin_to_move, "until gDT can be believed"
    ledger.update_rest(status)
    assert not ledger.may_begin_to_move


def test_the_age_of_a_write_counts_until_the_status_was_asked_for() -> None:
    """The reply may have been looked at long after."""
    history = History(100)
    entry = history.deliver(image(100, speed=7), 1.0)
    history.look(shows(100, 9.0), 1.0 + SILENT_S - EPSILON)
    assert not history.acts(entry)
    history.look(shows(100, 9.1), 1.0 + SILENT_S)
    assert history.acts(entry)


def test_a_speed_that_does_not_act_yet_sets_nothing_in_motion_while_rgto_is_clear() -> None:
    history = History(200)
    history.deliver(image(200, go=False), 1.0)
    for at in (1.01, 1.1 + WINDOW_S):
        history.look(shows(200, at, go=False))
    history.deliver(image(200, go=False, speed=7), 2.0)
    assert not history.is_settled
    assert not history.may_begin_to_move
    history.deliver(image(200, speed=7), 2.0)
    assert history.may_begin_to_move


# -- another client beside us ------------------------------------------------------------------------------


def test_the_requests_of_another_client_are_what_the_next_image_is_made_from() -> None:
    history = History(200)
    assert history.look(shows(77, 1.2)) is None
    history.adopt(history.latest)
    assert history.base == image(77), "speed and force stay as we last wrote them: they have no echo"
    assert history.look(shows(77, 1.3)) is not None


def test_an_axis_that_another_client_leaves_alone_stays_ours() -> None:
    ledger = found(shows(100, 1.0))
    ledger.write(image(200), A | B, 1.0)
    ledger.acknowledge(1.0)
    ledger.update(shows(200, 1.1), 1.1)
    other = status_of(0x39, 0xFF, echo=(200, 77, 200, 200), position=(200, 77, 200, 200), at=1.2)
    ledger.update(other, 1.2)
    ledger.adopt(other)
    assert ledger.ours == A, "B is asked for something else, and C was never moved by us"


def test_our_write_that_shows_after_another_clients_is_gone_on_from() -> None:
    history = History(200)
    history.deliver(image(30), 1.1, Finger.ALL)
    history.look(shows(77, 1.2))
    history.adopt(history.latest)
    assert history.has_recent_doubt, "our write may still act"
    assert history.ours == NO_AXES
    history.look(shows(30, 1.3))
    assert history.base == image(30)
    assert history.ours == Finger.ALL
    assert history.is_certain


def test_of_two_overtaken_writes_the_newest_is_what_the_gripper_has_once_the_first_shows() -> None:
    """It has acknowledged both and takes them in their order."""
    history = History(200)
    for position in (30, 40):
        history.deliver(image(position), 1.1)
    history.look(shows(77, 1.2))
    history.adopt(history.latest)
    history.look(shows(30, 1.21))
    assert history.base == image(40)


def test_of_two_overtaken_writes_the_first_is_no_more_in_doubt_once_the_second_shows() -> None:
    history = History(200)
    for position in (30, 40):
        history.deliver(image(position), 1.1)
    history.look(shows(77, 1.2))
    history.adopt(history.latest)
    history.look(shows(40, 1.21))
    assert history.base == image(40)
    assert history.is_certain


def test_an_axis_of_a_gripper_whose_rgto_another_client_has_set_is_not_doubted() -> None:
    """The request from the time with rGTO clear is not known, and needs no hold."""
    history = History(100)
    history.deliver(image(100, go=False), 1.0)
    history.look(shows(100, 1.1, go=False))
    history.restart(history.latest)
    history.adopt(shows(200, 1.2))
    assert history.requests.may_move(shows(200, 1.2), history.now) == NO_AXES


def test_a_client_that_keeps_writing_does_not_delay_us_anew() -> None:
    """A moving axis is given its time once, or nothing of ours would ever be written."""
    history = History(100)
    for n in range(10):
        moving = status_of(0x39, 0x00, echo=150 + n, position=50, at=2.0 + n * DIRECTION_WAIT_S / 5)
        assert history.look(moving) is None
        history.adopt(moving)
    assert history.is_certain


# -- the end of a procedure --------------------------------------------------------------------------------


@pytest.mark.parametrize("shown", [30, 77])
def test_a_procedure_ends_with_what_was_written_last_or_another_client_has_written(shown: int) -> None:
    history = History(200)
    history.deliver(image(30), 1.1)
    history.look(shows(shown, 1.2))
    assert history.restart(history.latest) == (shown == 30)
    assert history.is_settled


# -- axes that grip, and axes at rest ----------------------------------------------------------------------

GRIP = status_of(0x39, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))
"""A, B and the scissor touch something."""
HALTED = status_of(0x31, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))


@pytest.fixture
def later() -> History:
    """The ledger of a gripper sent from 100 to 200, when no status can be from before that."""
    history = History(100)
    history.deliver(image(200), 1.0, Finger.ALL)
    for n in range(LAG_READS + 2):
        history.look(status_of(0x39, 0x00, echo=200, position=150, at=1.1 + n * LAG_S))
        history.update_rest(history.latest)
    return history


def gripping(history: History, status: RobotiqStatus = HALTED) -> Finger:
    return history.gripping(status)


def test_axes_that_gripped_when_rgto_was_set_still_grip(later: History) -> None:
    later.update_rest(GRIP)
    assert gripping(later, GRIP) == A | B | S
    later.update_rest(status_of(0x31, 0xFF, echo=200, position=150))
    assert gripping(later) == A | B | S, "gDT is not worth reading while rGTO is clear"


def test_an_axis_that_is_somewhere_else_by_now_does_not_grip(later: History) -> None:
    later.update_rest(GRIP)
    assert gripping(later, status_of(0x31, 0xFF, position=(150, 6, 6, 152))) == A | S


def test_a_grip_by_a_request_no_longer_in_force_does_not_count(later: History) -> None:
    """A motion that was halted must not come back because the axis had gripped."""
    later.update_rest(GRIP)
    later.deliver(image(200).with_positions({A: 20}), 9.0)
    assert gripping(later) == B | S


def test_an_axis_has_arrived_when_it_was_seen_at_rest_under_what_it_was_asked_last(later: History) -> None:
    assert later.requests.unrested == A | B | C | S
    later.update_rest(status_of(0x39, 0b11_11_10_00, echo=200, position=(100, 150, 199, 200)))
    assert later.requests.unrested == A
    later.deliver(image(200).with_positions({B: 190}), 9.0, B)
    assert later.requests.unrested == A | B


def test_no_axis_arrives_under_what_does_not_act_yet_nor_while_rgto_is_clear() -> None:
    history = History(200)
    history.deliver(image(200).with_positions({A: 30}), 1.1, A)
    history.look(shows(200, 1.2))
    history.update_rest(history.latest)
    assert history.requests.unrested == A
    history.deliver(image(200, go=False).with_positions({A: 30}), 1.2)
    history.look(status_of(0x31, 0xFF, echo=(30, 200, 200, 200), position=30, at=1.3))
    history.update_rest(history.latest)
    assert history.requests.unrested == A


def test_a_short_move_before_another_client_wrote_does_not_end_the_next_one() -> None:
    """The late status of the short move is motion, and rest far from the request by then."""
    history = History(100)

    def shown(a: int, b: int, at: float, what: int = 0xFF) -> None:
        status = status_of(0x39, what, echo=(a, b, 100, 100), position=(min(a, 102), 100, 100, 100), at=at)
        if history.look(status) is None:
            history.adopt(status)
        history.update_rest(status)

    history.deliver(image(100).with_positions({A: 102}), 1.0, A)
    shown(102, 100, 1.01)
    shown(102, 101, 1.02)  # another client moves B by a count
    history.deliver(image(100).with_positions({A: 200, B: 101}), 1.03, A)
    shown(200, 101, 1.04, what=0b11_11_11_00)
    shown(200, 101, 1.05)
    assert history.requests.unrested & A


def test_a_write_that_shows_after_another_client_s_image_acts_from_then_on() -> None:
    """It was old enough to have acted before that image, and its motion may begin only now."""
    history = History(100)
    entry = history.deliver(image(100).with_positions({A: 200}), 1.0, A)
    other = status_of(0x39, 0xFF, echo=(100, 101, 100, 100), position=100, at=1.0 + WINDOW_S)
    assert history.look(other) is None
    history.adopt(other)
    history.update_rest(other)
    at = 1.0 + WINDOW_S + EPSILON
    late = status_of(0x39, 0b11_11_11_10, echo=(200, 100, 100, 100), position=(150, 100, 100, 100), at=at)
    assert history.look(late) is entry
    history.update_rest(late)
    assert history.requests.unrested & A


def test_a_contact_that_shows_as_rgto_rises_may_be_from_before() -> None:
    """With rGTO clear gDT means nothing, so nothing contradicts it."""
    history = History(100)
    history.deliver(image(100, go=False), 1.0)
    history.look(shows(100, 1.01, go=False))
    history.restart(history.latest)
    history.deliver(image(100).with_positions({A: 200}), 1.1, A)
    history.look(
        status_of(0x39, 0b11_11_11_10, echo=(200, 100, 100, 100), position=(150, 100, 100, 100), at=1.11)
    )
    history.update_rest(history.latest)
    assert history.requests.unrested & A


def test_a_motion_that_shows_as_rgto_rises_may_be_from_before() -> None:
    """A halt may have caught the axis, so the contact after it proves no rest either."""
    history = History(100)
    history.deliver(image(100, go=False), 1.0)
    history.look(shows(100, 1.01, go=False))
    history.restart(history.latest)
    history.deliver(image(100).with_positions({A: 200}), 1.1, A)
    for number, what in enumerate((ObjectStatus.IN_MOTION, ObjectStatus.CONTACT_CLOSING)):
        at = (150 + number, 100, 100, 100)
        history.look(
            status_of(
                0x39, 0b11_11_11_00 | what, echo=(200, 100, 100, 100), position=at, at=1.11 + number / 100
            )
        )
        history.update_rest(history.latest)
    assert history.requests.unrested & A


# -- any sequence ------------------------------------------------------------------------------------------


class Device:
    """Takes over the newest image at each tick of a clock of its own, and skips the ones between."""

    def __init__(self, cycle: float) -> None:
        self.cycle = cycle
        self.arrived: list[tuple[float, Entry]] = []

    def write(self, entry: Entry, at: float) -> None:
        self.arrived.append((at, entry))

    def acting(self, now: float) -> Entry:
        refreshed = now if self.cycle == 0 else now // self.cycle * self.cycle
        return next(entry for at, entry in reversed(self.arrived) if at <= refreshed)


IMAGES = [
    image(position, speed=speed, go=go)
    for position in (0, 100, 200)
    for speed in (1, 2)
    for go in (False, True)
]
STEPS = st.lists(
    st.tuples(
        st.sampled_from([0.001, 0.005, 0.02, 0.06, 0.3]), st.sampled_from([*IMAGES, *[None] * len(IMAGES)])
    ),
    max_size=40,
)


def status_from(device: Device, now: float) -> RobotiqStatus:
    request = device.acting(now).image
    return shows(request.axes[0].position, now, go=request.go)


@settings(deadline=None)
@given(st.sampled_from([0.0, 0.005, 0.01, 0.05, 0.2]), STEPS)
def test_our_own_writes_are_never_foreign_and_never_act_too_early(
    cycle: float, steps: list[tuple[float, Request | None]]
) -> None:
    history, device, now = History(), Device(cycle), 0.0
    device.write(history.last, -1.0)
    written = [history.last]
    for pause, request in steps:
        now += pause
        if request is not None:
            entry = history.deliver(request, now)
            written.append(entry)
            device.write(entry, now)
        status = status_from(device, now)
        shown = history.look(status)
        assert shown is not None, "our own write was taken for another client"
        acting = device.acting(now)
        assert shown.echo == acting.echo
        for number, each in enumerate(written):
            # A silent change is given five cycles of a 100 Hz device; a slower one may need longer.
            silent = each.echo == acting.echo
            if history.acts(each) and not (silent and cycle > SILENT_S):
                assert written.index(acting) >= number or acting.image == each.image
    now += WINDOW_S + cycle
    assert history.look(status_from(device, now)) is not None
    assert history.is_settled


@given(STEPS, st.integers(1, 99))
def test_a_position_that_was_never_written_is_foreign_at_any_time(
    steps: list[tuple[float, Request | None]], foreign: int
) -> None:
    history, now = History(), 0.0
    for pause, request in steps:
        now += pause
        if request is not None:
            history.deliver(request, now)
        assert history.look(shows(foreign, now)) is None


# -- what a look costs, in calls: the same on every machine ------------------------------------------------


def calls(what: Callable[[], object]) -> int:
    """The number of Python functions that are called."""
    count = 0

    def see(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event == "call"

    gc.disable()  # a collection calls what others have registered for it, and these calls would count
    sys.setprofile(see)
    try:
        what()
    finally:
        sys.setprofile(None)
        gc.enable()
    return count


def cost_of_a_look(writes: int) -> int:
    """The calls for the status after so many writes, none of which is echoed."""
    history, now = History(255), 0.0
    for number in range(writes):
        now += 0.005
        history.deliver(image(number % 200), now)

    def look() -> None:
        history.update(shows(255, now), now)
        assert not history.has_recent_doubt

    return calls(look)


def test_a_look_at_a_status_calls_nothing_for_each_write_of_the_last_half_second() -> None:
    assert cost_of_a_look(90) <= cost_of_a_look(10)
