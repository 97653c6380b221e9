"""The shadow of the requests: what the next image is made from, whose it is, what grips and rests."""

from __future__ import annotations

import pytest

from robotiq_async.control.requests.adoption import DIRECTION_WAIT_S
from robotiq_async.control.requests.merging import at_rest
from robotiq_async.control.requests.shadow import RequestShadow, Whose
from robotiq_async.control.requests.standstill import LAG_READS, LAG_S
from robotiq_async.control.requests.writes import SILENT_S, WINDOW_S
from robotiq_async.values.enums import NO_AXES, Finger
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import EPSILON, image, shows
from tests.register_words import status_of

A, B, C, S = THREE_FINGER.axes


def positions(request: Request) -> list[int]:
    return [request.position(axis) for axis in THREE_FINGER.axes]


class Shadow(RequestShadow):
    """One that sees statuses as they are answered, and writes that are acknowledged at once."""

    def __init__(self) -> None:
        super().__init__(128, 64)
        self.at = 0.0

    def shown(self, status: RobotiqStatus, at: float) -> RobotiqStatus:
        self.at = at
        self.see(status, at)
        return status

    def follows(self, status: RobotiqStatus) -> bool:
        """Whether it goes on from a status that shows requests of ours, or those that were adopted."""
        whose = self.identify()
        if whose is not Whose.FOREIGN:
            self.follow(whose, status)
        return whose is not Whose.FOREIGN

    def write(self, request: Request, moved: Finger = Finger.ALL, *, answered: bool = True) -> int:
        number = self.writing(request, moved, self.at)
        if answered:
            self.acknowledged(self.at)
        else:
            self.lost()
        return number


@pytest.fixture
def shadow() -> Shadow:
    """Of a gripper that another client has brought to 100, and that the hand has found at 1.0."""
    shadow = Shadow()
    shadow.returned(shadow.shown(shows(100, 1.0), 1.0))
    return shadow


@pytest.fixture
def ours(shadow: Shadow) -> Shadow:
    """Of a gripper that we have sent from 100 to 200."""
    shadow.write(image(200))
    assert shadow.follows(shadow.shown(shows(200, 1.1), 1.1))
    return shadow


@pytest.fixture
def later(ours: Shadow) -> Shadow:
    """The same, when no status can be from before our request."""
    for _ in range(LAG_READS + 1):
        ours.axes.see(ours.shown(status_of(0x39, 0x00, echo=200, position=150), ours.at + LAG_S), ours.now)
    return ours


# -- before anything was written ---------------------------------------------------------------------------


def test_before_anything_is_known_every_axis_has_the_settings_of_the_hand() -> None:
    shadow = RequestShadow(128, 64)
    assert shadow.base == Request(axes=(AxisRequest(0, 128, 64),) * 4)


def test_the_first_image_shown_is_not_ours_but_settled(shadow: Shadow) -> None:
    assert shadow.base == image(100, speed=128, force=64)
    assert shadow.ours == NO_AXES
    assert not shadow.may_begin_to_move
    found_reset = Shadow()
    found_reset.shown(status_of(0x00), 1.0)
    for each in (shadow, found_reset):
        assert each.acts()
        assert each.doubt is None


def test_a_moving_gripper_that_is_found_is_not_certain_before_it_has_shown_its_direction() -> None:
    shadow, moving = Shadow(), status_of(0x39, 0x00, echo=100, position=50)
    shadow.returned(shadow.shown(moving, 1.0))
    assert shadow.doubt is not None
    assert shadow.follows(shadow.shown(moving, 1.0 + DIRECTION_WAIT_S))
    assert shadow.doubt is None


def test_at_rest_nothing_could_be_woken(ours: Shadow) -> None:
    """With rGTO clear, every axis is asked to be where it is."""
    resting = at_rest(ours.base, status_of(0x39, 0x00, echo=200, position=(1, 2, 3, 4)))
    assert not resting.go
    assert positions(resting) == [1, 2, 3, 4]
    assert [(axis.speed, axis.force) for axis in resting.axes] == [(100, 50)] * 4


# -- what we write -----------------------------------------------------------------------------------------


def test_a_write_is_what_the_next_is_made_from_and_acts_once_it_shows(shadow: Shadow) -> None:
    number = shadow.write(image(200))
    assert shadow.base == image(200)
    assert shadow.ours == Finger.ALL
    assert shadow.follows(shadow.shown(shows(100, 1.01), 1.01))
    assert not shadow.acts(number)
    assert not shadow.acts()
    assert shadow.may_begin_to_move
    assert shadow.follows(shadow.shown(shows(200, 1.02), 1.02))
    assert shadow.acts(number)
    assert shadow.acts()
    assert shadow.may_begin_to_move, "until gDT can be believed"
    shadow.axes.see(shows(200, 1.02), shadow.now)
    assert not shadow.may_begin_to_move


def test_the_age_of_a_write_counts_until_the_status_was_asked_for(shadow: Shadow) -> None:
    """The reply may have been looked at long after."""
    number = shadow.write(image(100, speed=7))
    shadow.see(shows(100, 9.0), 1.0 + SILENT_S - EPSILON)
    assert not shadow.acts(number)
    shadow.see(shows(100, 9.1), 1.0 + SILENT_S)
    assert shadow.acts(number)


def test_a_speed_that_does_not_act_yet_sets_nothing_in_motion_while_rgto_is_clear(ours: Shadow) -> None:
    ours.write(image(200, go=False))
    ours.shown(shows(200, 1.2 + WINDOW_S, go=False), 1.2 + WINDOW_S)
    ours.shown(shows(200, 1.3 + 2 * WINDOW_S, go=False), 1.3 + 2 * WINDOW_S)
    ours.write(image(200, go=False, speed=7))
    assert not ours.acts()
    assert not ours.may_begin_to_move
    ours.write(image(200, speed=7))
    assert ours.may_begin_to_move


# -- another client beside us ------------------------------------------------------------------------------


def test_the_requests_of_another_client_are_what_the_next_image_is_made_from(ours: Shadow) -> None:
    status = ours.shown(shows(77, 1.2), 1.2)
    assert not ours.follows(status)
    ours.follow(Whose.FOREIGN, status)
    assert ours.base == image(77), "speed and force stay as we last wrote them: they have no echo"
    assert ours.follows(ours.shown(shows(77, 1.3), 1.3))


def test_an_axis_that_another_client_leaves_alone_stays_ours(shadow: Shadow) -> None:
    shadow.write(image(200), moved=A | B)
    shadow.shown(shows(200, 1.1), 1.1)
    shadow.follow(
        Whose.FOREIGN,
        shadow.shown(status_of(0x39, 0xFF, echo=(200, 77, 200, 200), position=(200, 77, 200, 200)), 1.2),
    )
    assert shadow.ours == A, "B is asked for something else, and C was never moved by us"


def test_our_write_that_shows_after_another_clients_is_gone_on_from(ours: Shadow) -> None:
    ours.write(image(30))
    ours.follow(Whose.FOREIGN, ours.shown(shows(77, 1.2), 1.2))
    assert ours.doubt is not None, "our write may still act"
    assert ours.follows(ours.shown(shows(30, 1.3), 1.3))
    assert ours.base == image(30)
    assert ours.ours == Finger.ALL
    assert ours.doubt is None


def test_a_client_that_keeps_writing_does_not_delay_us_anew(shadow: Shadow) -> None:
    """A moving axis is given its time once, or nothing of ours would ever be written."""
    for n in range(10):
        at = 2.0 + n * DIRECTION_WAIT_S / 5
        moving = status_of(0x39, 0x00, echo=150 + n, position=50)
        assert not shadow.follows(shadow.shown(moving, at))
        shadow.follow(Whose.FOREIGN, moving)
    assert shadow.doubt is None


# -- a link that comes back --------------------------------------------------------------------------------


@pytest.mark.parametrize(("position", "axes"), [(200, Finger.ALL), (77, NO_AXES)])
def test_an_image_of_ours_shown_after_a_link_loss_is_ours(ours: Shadow, position: int, axes: Finger) -> None:
    ours.lost()
    ours.returned(ours.shown(shows(position, 9.0), 9.0))
    assert ours.base == image(position)
    assert ours.ours == axes
    assert ours.doubt is None


def test_an_adopted_request_is_not_ours_after_a_link_loss(shadow: Shadow) -> None:
    """Under simple control B and C echo 0: taken for our own image, it would have let go."""
    shadow.lost()
    shadow.returned(shadow.shown(shows(100, 2.0), 2.0))
    assert shadow.ours == NO_AXES


@pytest.mark.parametrize("arrived", [True, False])
def test_a_write_that_may_have_arrived_is_waited_for(ours: Shadow, arrived: bool) -> None:
    ours.write(image(30), answered=False)
    ours.returned(ours.shown(shows(200, 1.2), 1.2))
    assert ours.base == image(200)
    assert ours.doubt is not None
    position = 30 if arrived else 200
    at = 1.3 if arrived else 1.15 + SILENT_S
    assert ours.follows(ours.shown(shows(position, at), at))
    assert ours.base == image(position)
    assert ours.doubt is None, "what has not shown by now has not arrived"


@pytest.mark.parametrize("acknowledged", [True, False])
def test_a_speed_is_kept_over_a_lost_link_if_it_was_acknowledged(ours: Shadow, acknowledged: bool) -> None:
    ours.write(image(200, speed=7), answered=acknowledged)
    ours.lost()
    ours.returned(ours.shown(shows(200, 1.2), 1.2))
    assert ours.base == (image(200, speed=7) if acknowledged else image(200))


# -- the end of a sequence ---------------------------------------------------------------------------------


@pytest.mark.parametrize("shown", [30, 77])
def test_a_sequence_ends_with_what_was_written_last_or_another_client_has_written(
    ours: Shadow, shown: int
) -> None:
    ours.write(image(30))
    assert ours.restart(ours.shown(shows(shown, 1.2), 1.2)) == (shown == 30)
    assert ours.acts()


# -- axes that grip, and axes at rest ----------------------------------------------------------------------

GRIP = status_of(0x39, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))
"""A, B and the scissor touch something."""
HALTED = status_of(0x31, 0b10_11_10_10, echo=200, position=(150, 150, 200, 150))


def gripping(ours: Shadow, status: RobotiqStatus = HALTED) -> Finger:
    return ours.axes.grips.held(status, ours.base)


def test_axes_that_gripped_when_rgto_was_set_still_grip(later: Shadow) -> None:
    later.axes.see(GRIP, later.now)
    assert gripping(later, GRIP) == A | B | S
    later.axes.see(status_of(0x31, 0xFF, echo=200, position=150), later.now)
    assert gripping(later) == A | B | S, "gDT is not worth reading while rGTO is clear"


def test_an_axis_that_is_somewhere_else_by_now_does_not_grip(later: Shadow) -> None:
    later.axes.see(GRIP, later.now)
    assert gripping(later, status_of(0x31, 0xFF, position=(150, 6, 6, 152))) == A | S


def test_a_grip_by_a_request_no_longer_in_force_does_not_count(later: Shadow) -> None:
    """A motion that was halted must not come back because the axis had gripped."""
    later.axes.see(GRIP, later.now)
    later.write(image(200).with_positions({A: 20}), moved=NO_AXES)
    assert gripping(later) == B | S


@pytest.mark.parametrize("how", ["moved", "adopted", "sequence"])
def test_a_grip_ends(later: Shadow, how: str) -> None:
    later.axes.see(GRIP, later.now)
    match how:
        case "moved":
            later.write(image(200), moved=A)
        case "adopted":
            later.follow(Whose.FOREIGN, GRIP)
        case "sequence":
            later.axes.grips.forget()
    assert gripping(later) == (B | S if how == "moved" else NO_AXES)


def test_an_axis_has_arrived_when_it_was_seen_at_rest_under_what_it_was_asked_last(later: Shadow) -> None:
    assert later.axes.resting == NO_AXES
    later.axes.see(status_of(0x39, 0b11_11_10_00, echo=200, position=(100, 150, 199, 200)), later.now)
    assert later.axes.resting == B | C | S
    later.write(image(200).with_positions({B: 190}), moved=B)
    assert later.axes.resting == C | S


def test_no_axis_arrives_under_what_does_not_act_yet_nor_while_rgto_is_clear(ours: Shadow) -> None:
    ours.write(image(30), moved=A)
    ours.axes.see(ours.shown(shows(200, 1.2), 1.2), ours.now)
    assert A not in ours.axes.resting
    ours.write(image(200, go=False))
    ours.axes.see(ours.shown(shows(200, 1.2, go=False), 1.2), ours.now)
    assert ours.axes.resting == NO_AXES


def test_an_axis_that_we_never_moved_counts_as_arrived(shadow: Shadow) -> None:
    assert shadow.axes.resting == Finger.ALL
