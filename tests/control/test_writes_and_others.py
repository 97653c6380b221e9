"""What another client has written, and what became of ours when the link came back."""

from __future__ import annotations

import pytest

from robotiq_async.control.requests.writes import WINDOW_S, WriteHistory
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import EPSILON, History, image, shows
from tests.register_words import status_of

# -- other clients -----------------------------------------------------------------------------------------


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
def test_what_was_never_written_is_somebody_else_s(status: RobotiqStatus) -> None:
    history = History()
    history.write(image(50), 0.9)
    assert history.see_at_once(status) is None


def test_another_client_stays_foreign_until_its_image_is_taken_over() -> None:
    history = History()
    assert history.see_at_once(shows(77, 1.0)) is None
    assert history.see_at_once(shows(77, 1.1)) is None
    history.adopt(image(77), image(77).echo, 1.1)
    assert history.see_at_once(shows(77, 1.2)) == image(77)
    assert history.is_settled(1.2)


def test_an_older_image_may_come_back_within_the_window_and_is_foreign_afterwards() -> None:
    history = History(100)
    history.write(image(200), 1.0)
    history.see_at_once(shows(200, 1.01))
    assert history.see_at_once(shows(100, 1.0 + WINDOW_S)) == image(100)
    assert history.see_at_once(shows(100, 1.0 + WINDOW_S + EPSILON)) is None


def test_the_last_image_is_ours_for_ever() -> None:
    history = History()
    history.write(image(200), 1.0)
    assert history.see_at_once(shows(200, 1.01)) == image(200)
    assert history.see_at_once(shows(200, 1e6)) == image(200)


def test_of_older_images_the_newest_before_the_window_is_kept() -> None:
    history = History()
    history.write(image(10), 1.0)
    history.write(image(20), 2.0)
    history.write(image(30), 2.4)
    history.see_at_once(shows(30, 2.41))
    # 20 was what the gripper had when the window began; 10 was not.
    assert history.see_at_once(shows(20, 2.6)) == image(20)
    assert history.see_at_once(shows(10, 2.6)) is None


def test_a_long_life_does_not_make_the_history_remember_more() -> None:
    history = History()
    for n in range(2000):
        history.write(image(n % 256), n / 10)
        assert history.see_at_once(shows(n % 256, n / 10 + 0.01)) == image(n % 256)
    assert len(history._writes) <= WINDOW_S * 10 + 2


def test_another_client_that_undoes_our_write_before_it_shows_is_noticed_after_the_window() -> None:
    """A client that repeats its own image faster than we poll: ours never shows."""
    history = History(100)
    history.write(image(200), 1.0)
    assert history.see_at_once(shows(100, 1.005)) == image(100)
    assert history.see_at_once(shows(100, 1.0 + WINDOW_S + EPSILON)) is None


# -- a link that comes back --------------------------------------------------------------------------------


def test_a_write_that_was_not_acknowledged_may_still_show_after_a_reconnect() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.lost()
    # 100 still shows when the link is back.
    assert history.see_at_once(shows(100, 1.1)) == image(100)
    history.adopt(image(100), image(100).echo, 1.1)
    assert not history.is_settled(1.1)
    assert history.see_at_once(shows(100, 1.12)) == image(100)
    assert history.see_at_once(shows(200, 1.15)) == image(200)
    assert history.is_settled(1.15)


def test_a_write_that_had_arrived_before_the_link_went_down_is_ours() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.lost()
    assert history.see_at_once(shows(200, 1.0 + WINDOW_S)) == image(200)


def test_a_write_whose_acknowledgement_never_came_is_ours_whenever_it_shows() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    assert history.see_at_once(shows(200, 30.0)) == image(200)


def test_a_write_that_was_lost_with_the_link_is_waited_for_in_the_window_only() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.lost()
    history.adopt(image(100), image(100).echo, 9.0)
    assert not history.is_settled(9.0 + WINDOW_S - EPSILON)
    assert history.is_settled(9.0 + WINDOW_S)
    assert history.see_at_once(shows(100, 20.0)) == image(100)


def test_a_write_that_was_lost_with_the_link_is_foreign_when_it_shows_after_the_window() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.lost()
    history.adopt(image(100), image(100).echo, 9.0)
    assert history.see_at_once(shows(100, 9.0 + 2 * WINDOW_S)) == image(100)
    assert history.see_at_once(shows(200, 9.0 + 3 * WINDOW_S)) is None


def test_what_had_shown_before_an_adoption_is_forgotten() -> None:
    history = History(100)
    history.write(image(200), 1.0)
    history.see_at_once(shows(200, 1.01))
    history.adopt(image(77), image(77).echo, 1.02)
    assert history.see_at_once(shows(100, 1.03)) is None
    assert history.see_at_once(shows(200, 1.03)) is None


def test_a_restart_forgets_everything() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.restart(image(50), image(50).echo, 1.1)
    assert history.see_at_once(shows(50, 1.11)) == image(50)
    assert history.see_at_once(shows(200, 1.12)) is None
    assert history.see_at_once(shows(100, 1.13)) is None


def test_what_is_shown_may_differ_from_the_image_that_is_taken_for_it() -> None:
    """Simple control: B, C and the scissor echo 0 and are asked for something else."""
    history = WriteHistory()
    history.restart(image(80), (True, True, 80, 0, 0, 0), 0.0)
    assert history.see(status_of(0x39, echo=(80, 0, 0, 0)), 0.1) == image(80)


def test_an_old_status_that_is_looked_at_late_is_compared_with_what_was_written_then() -> None:
    """What it shows is as old as its request, however late the reply was looked at."""
    history = History(100)
    history.write(image(200), 1.0)
    assert history.see(shows(100, 1.7), 1.0) == image(100)
    assert not history.acts(history.last_number, 1.0)


# -- what is in doubt --------------------------------------------------------------------------------------


def test_a_write_that_is_lost_with_the_link_is_in_doubt_until_it_shows() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    assert not history.is_in_doubt, "it is on the line"
    history.lost()
    assert history.is_in_doubt
    history.adopt(image(100), image(100).echo, 1.1)
    assert history.is_in_doubt
    history.see_at_once(shows(200, 1.2))
    assert not history.is_in_doubt


def test_a_write_that_is_lost_with_the_link_is_in_doubt_no_longer_than_the_window() -> None:
    history = History(100)
    history.writing(image(200), 1.0)
    history.lost()
    history.adopt(image(100), image(100).echo, 1.1)
    history.see_at_once(shows(100, 1.1 + WINDOW_S))
    assert history.is_in_doubt
    history.see_at_once(shows(100, 1.1 + WINDOW_S + EPSILON))
    assert not history.is_in_doubt


def test_a_write_that_was_acknowledged_is_not_lost_with_the_link() -> None:
    history = History(100)
    history.write(image(200), 1.0)
    history.lost()
    assert not history.is_in_doubt


def test_a_write_that_another_clients_overtook_may_still_act_for_as_long_as_the_window() -> None:
    history = History(100)
    history.write(image(200), 1.0)
    history.see_at_once(shows(77, 1.01))
    history.adopt(image(77), image(77).echo, 1.01)
    assert history.is_in_doubt
    assert history.see_at_once(shows(200, 1.02)) == image(200)
    assert not history.is_in_doubt


def test_no_link_is_lost_before_anything_was_written() -> None:
    history = WriteHistory()
    history.lost()
    assert not history.is_in_doubt


# -- what cannot be told apart -----------------------------------------------------------------------------


def test_of_images_that_show_alike_the_newest_that_has_arrived_is_the_one_in_force() -> None:
    history = History(100)
    shown = history.see_at_once(shows(100, 0.9))
    assert shown is not None
    history.write(image(100, speed=7), 1.0)
    assert history.newest_that_shows_like(shown) == image(100, speed=7)


def test_an_image_that_may_not_have_arrived_is_not_taken_for_the_one_in_force() -> None:
    """Its speed and force have no echo that could tell."""
    history = History(100)
    shown = history.see_at_once(shows(100, 0.9))
    assert shown is not None
    history.writing(image(100, speed=7), 1.0)
    history.lost()
    assert history.newest_that_shows_like(shown) == image(100)


def test_an_image_that_nobody_remembers_is_in_force_itself() -> None:
    assert History(100).newest_that_shows_like(image(5)) == image(5)


def test_images_look_alike_until_one_of_them_asks_for_something_that_is_echoed() -> None:
    history = History(100)
    assert history.all_look_alike
    history.write(image(100, speed=7), 1.0)
    assert history.all_look_alike
    history.write(image(101, speed=7), 1.1)
    assert not history.all_look_alike
