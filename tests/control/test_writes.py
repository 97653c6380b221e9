"""Which of the written images a gripper shows, from when on it acts, and what a look at a status costs."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.control.requests.writes import SILENT_S, WINDOW_S
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import EPSILON, History, image, shows

# -- one write ---------------------------------------------------------------------------------------------


def test_what_the_gripper_showed_at_the_start_is_ours() -> None:
    history = History(30)
    assert history.see_at_once(shows(30, 0.0)) == image(30)
    assert history.is_settled(0.0)


def test_the_images_are_numbered_one_by_one() -> None:
    history = History()
    before = history.last_number
    assert history.write(image(1), 0.1) == history.last_number == before + 1
    assert history.write(image(2), 0.2) == history.last_number == before + 2


def test_a_write_acts_once_its_echo_is_seen() -> None:
    history = History()
    number = history.write(image(100), 1.0)
    assert history.see_at_once(shows(0, 1.005)) == image(0)
    assert not history.acts(number, 1.005)
    assert not history.is_settled(1.005)
    assert history.see_at_once(shows(100, 1.010)) == image(100)
    assert history.acts(number, 1.010)
    assert history.is_settled(1.010)


def test_an_echo_before_the_acknowledgement_counts() -> None:
    history = History()
    number = history.writing(image(100), 1.0)
    assert history.see_at_once(shows(100, 1.005)) == image(100)
    assert history.acts(number, 1.005)


def test_a_write_that_is_not_acknowledged_never_acts_by_the_passing_of_time() -> None:
    history = History()
    number = history.writing(image(100), 1.0)
    assert not history.acts(number, 1.0 + 100 * WINDOW_S)


def test_a_write_without_an_echo_of_its_own_acts_when_the_window_is_over() -> None:
    history = History()
    number = history.write(image(100), 1.0)
    assert not history.acts(number, 1.0 + WINDOW_S - EPSILON)
    assert history.acts(number, 1.0 + WINDOW_S)


def test_the_window_is_counted_from_the_acknowledgement() -> None:
    history = History()
    number = history.writing(image(100), 1.0)
    history.acknowledged(1.3)
    assert not history.acts(number, 1.3 + WINDOW_S - EPSILON)
    assert history.acts(number, 1.3 + WINDOW_S)


def test_a_cleared_go_bit_is_an_echo_too() -> None:
    history = History()
    number = history.write(image(0, go=False), 1.0)
    assert history.see_at_once(shows(0, 1.005)) == image(0)
    assert not history.acts(number, 1.005)
    assert history.see_at_once(shows(0, 1.010, go=False)) == image(0, go=False)
    assert history.acts(number, 1.010)


# -- several writes ----------------------------------------------------------------------------------------


def test_there_and_back_is_not_mistaken_for_never_having_gone() -> None:
    """100, 200, 100: the first 100 must not be taken for the second."""
    history = History(100)
    there = history.write(image(200), 1.00)
    back = history.write(image(100), 1.01)
    assert history.see_at_once(shows(100, 1.015)) == image(100)
    assert not history.acts(there, 1.015)
    assert not history.acts(back, 1.015)
    assert history.see_at_once(shows(200, 1.020)) == image(200)
    assert history.acts(there, 1.020)
    assert not history.acts(back, 1.020)
    assert history.see_at_once(shows(100, 1.025)) == image(100)
    assert history.acts(back, 1.025)
    assert history.is_settled(1.025)


def test_there_and_back_written_from_elsewhere_acts_in_order_too() -> None:
    history = History(0)
    numbers = [history.write(image(position), 1.0 + n / 100) for n, position in enumerate((100, 200, 100))]
    acted = []
    for n, position in enumerate((0, 100, 100, 200, 100)):
        at = 1.04 + n / 100
        assert history.see_at_once(shows(position, at)) == image(position)
        acted.append([history.acts(number, at) for number in numbers])
    assert acted == [
        [False, False, False],
        [True, False, False],
        [True, False, False],
        [True, True, False],
        [True, True, True],
    ]


def test_there_and_back_that_never_showed_acts_when_the_window_is_over() -> None:
    history = History(100)
    history.write(image(200), 1.00)
    back = history.write(image(100), 1.01)
    assert history.see_at_once(shows(100, 1.0 + WINDOW_S - EPSILON)) == image(100)
    assert not history.acts(back, 1.0 + WINDOW_S - EPSILON)
    assert history.acts(back, 1.01 + WINDOW_S)


def test_a_slow_gripper_that_shows_the_image_before_the_last_is_ours() -> None:
    history = History()
    for n, position in enumerate((10, 20, 30)):
        history.write(image(position), 1.0 + n / 10)
    assert history.see_at_once(shows(10, 1.21)) == image(10)
    assert history.see_at_once(shows(10, 1.22)) == image(10)
    assert history.see_at_once(shows(20, 1.31)) == image(20)
    assert history.see_at_once(shows(30, 1.41)) == image(30)


def test_a_gripper_may_skip_an_image() -> None:
    history = History()
    skipped = history.write(image(10), 1.00)
    last = history.write(image(20), 1.01)
    assert history.see_at_once(shows(0, 1.02)) == image(0)
    assert history.see_at_once(shows(20, 1.03)) == image(20)
    assert history.acts(last, 1.03)
    assert history.acts(skipped, 1.03), "a later image acts, so it need not be waited for"


# -- changes without an echo -------------------------------------------------------------------------------


@pytest.mark.parametrize("change", [image(0, speed=200), image(0, force=200)], ids=["speed", "force"])
def test_a_silent_change_acts_after_its_time(change: Request) -> None:
    history = History()
    number = history.write(change, 1.0)
    history.see_at_once(shows(0, 1.005))
    assert not history.acts(number, 1.005)
    assert not history.acts(number, 1.0 + SILENT_S - EPSILON)
    assert history.acts(number, 1.0 + SILENT_S)


def test_an_identical_image_acts_at_once() -> None:
    history = History()
    assert history.acts(history.write(image(0), 1.0), 1.0)


def test_a_silent_change_behind_a_visible_one_waits_for_it() -> None:
    history = History()
    history.write(image(100), 1.00)
    silent = history.write(image(100, speed=200), 1.01)
    assert not history.acts(silent, 1.01 + SILENT_S)
    history.see_at_once(shows(100, 1.02 + SILENT_S))
    assert history.acts(silent, 1.02 + SILENT_S)


def test_a_silent_change_right_behind_a_visible_one_is_given_its_time_after_the_echo() -> None:
    history = History()
    history.write(image(100), 1.000)
    silent = history.write(image(100, speed=200), 1.001)
    history.see_at_once(shows(100, 1.010))
    assert not history.acts(silent, 1.010)
    assert history.acts(silent, 1.001 + SILENT_S)


def test_a_visible_change_behind_a_silent_one_shows_that_both_act() -> None:
    history = History()
    silent = history.write(image(0, speed=200), 1.00)
    history.write(image(100, speed=200), 1.01)
    history.see_at_once(shows(100, 1.02))
    assert history.acts(silent, 1.02)


# -- any sequence ------------------------------------------------------------------------------------------


class Device:
    """Takes over the newest image at each tick of a clock of its own, and skips the ones between."""

    def __init__(self, cycle: float) -> None:
        self.cycle = cycle
        self.arrived: list[tuple[float, int, Request]] = []

    def write(self, number: int, request: Request, at: float) -> None:
        self.arrived.append((at, number, request))

    def acting(self, now: float) -> tuple[int, Request]:
        refreshed = now if self.cycle == 0 else now // self.cycle * self.cycle
        return next((number, request) for at, number, request in reversed(self.arrived) if at <= refreshed)


STEPS = st.lists(
    st.tuples(
        st.sampled_from([0.001, 0.005, 0.02, 0.06, 0.3]),
        st.none()
        | st.builds(image, st.sampled_from([0, 100, 200]), speed=st.sampled_from([1, 2]), go=st.booleans()),
    ),
    max_size=40,
)


def status_from(device: Device, now: float) -> RobotiqStatus:
    _, request = device.acting(now)
    return shows(request.axes[0].position, now, go=request.go)


@settings(deadline=None)
@given(st.sampled_from([0.0, 0.005, 0.01, 0.05, 0.2]), STEPS)
def test_our_own_writes_are_never_foreign_and_never_act_too_early(
    cycle: float, steps: list[tuple[float, Request | None]]
) -> None:
    history, device, now = History(), Device(cycle), 0.0
    device.write(history.last_number, image(0), -1.0)
    written = {history.last_number: image(0)}
    for pause, request in steps:
        now += pause
        if request is not None:
            number = history.write(request, now)
            written[number] = request
            device.write(number, request, now)
        status = status_from(device, now)
        shown = history.see_at_once(status)
        assert shown is not None, "our own write was taken for another client"
        assert shown.echo == device.acting(now)[1].echo
        acting, acts = device.acting(now)
        for number, each in written.items():
            # A silent change is given five cycles of a 100 Hz device; a slower one may need longer.
            silent = each.echo == acts.echo
            if history.acts(number, now) and not (silent and cycle > SILENT_S):
                assert acting >= number or acts == each
    now += WINDOW_S + cycle
    assert history.see_at_once(status_from(device, now)) is not None
    assert history.is_settled(now)


@given(STEPS, st.integers(1, 99))
def test_a_position_that_was_never_written_is_foreign_at_any_time(
    steps: list[tuple[float, Request | None]], foreign: int
) -> None:
    history, now = History(), 0.0
    for pause, request in steps:
        now += pause
        if request is not None:
            history.write(request, now)
        assert history.see_at_once(shows(foreign, now)) is None


# -- what a look costs, in calls: the same on every machine ------------------------------------------------


def calls(what: Callable[[], object]) -> int:
    """How many functions of Python are called."""
    count = 0

    def see(_frame: FrameType, event: str, _argument: object) -> None:
        nonlocal count
        count += event == "call"

    sys.setprofile(see)
    try:
        what()
    finally:
        sys.setprofile(None)
    return count


def cost_of_a_look(writes: int) -> int:
    """That of the status after so many writes, none of which shows."""
    history, now = History(255), 0.0
    for number in range(writes):
        now += 0.005
        history.write(image(number % 200), now)

    def look() -> None:
        history.see(shows(250, now), now)
        assert not history.is_in_doubt

    return calls(look)


def test_a_look_at_a_status_calls_nothing_for_each_write_of_the_last_half_second() -> None:
    assert cost_of_a_look(90) <= cost_of_a_look(10)
