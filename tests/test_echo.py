"""Which of the written images a gripper shows: slow ones, skipping ones, and other clients."""

from __future__ import annotations

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.control.sequences import signature_of
from robotiq_async.control.writes import SILENT_S, WINDOW_S, EchoWatch
from robotiq_async.wire.request import AxisRequest, Request
from robotiq_async.wire.status import RobotiqStatus
from tests.words import status_of

EPSILON = 0.001


def image(position: int, *, speed: int = 100, force: int = 50, go: bool = True) -> Request:
    return Request(activate=True, go=go, axes=(AxisRequest(position, speed, force),) * 4)


def shows(position: int, at: float, *, go: bool = True) -> RobotiqStatus:
    return status_of(0x31 | go << 3, 0xFF, echo=position, position=position, at=at)


class Watched(EchoWatch):
    """A watch on a gripper that shows position 0, and writes that are acknowledged at once."""

    def __init__(self, position: int = 0) -> None:
        super().__init__()
        self.restart(image(position), signature_of(image(position)), 0.0)

    def write(self, request: Request, at: float) -> int:
        number = self.writing(request, at)
        self.acknowledged(at)
        return number


# -- one write ---------------------------------------------------------------------------------------------


def test_what_the_gripper_showed_at_the_start_is_ours() -> None:
    watch = Watched(30)
    assert watch.observe(shows(30, 0.0)) == image(30)
    assert watch.is_settled(0.0)


def test_the_images_are_numbered_one_by_one() -> None:
    watch = Watched()
    before = watch.last_number
    assert watch.write(image(1), 0.1) == watch.last_number == before + 1
    assert watch.write(image(2), 0.2) == watch.last_number == before + 2


def test_a_write_acts_once_its_echo_is_seen() -> None:
    watch = Watched()
    number = watch.write(image(100), 1.0)
    assert watch.observe(shows(0, 1.005)) == image(0)
    assert not watch.acts(number, 1.005)
    assert not watch.is_settled(1.005)
    assert watch.observe(shows(100, 1.010)) == image(100)
    assert watch.acts(number, 1.010)
    assert watch.is_settled(1.010)


def test_an_echo_before_the_acknowledgement_counts() -> None:
    watch = Watched()
    number = watch.writing(image(100), 1.0)
    assert watch.observe(shows(100, 1.005)) == image(100)
    assert watch.acts(number, 1.005)


def test_a_write_that_is_not_acknowledged_never_acts_by_the_passing_of_time() -> None:
    watch = Watched()
    number = watch.writing(image(100), 1.0)
    assert not watch.acts(number, 1.0 + 100 * WINDOW_S)


def test_a_write_without_an_echo_of_its_own_acts_when_the_window_is_over() -> None:
    watch = Watched()
    number = watch.write(image(100), 1.0)
    assert not watch.acts(number, 1.0 + WINDOW_S - EPSILON)
    assert watch.acts(number, 1.0 + WINDOW_S)


def test_the_window_is_counted_from_the_acknowledgement() -> None:
    watch = Watched()
    number = watch.writing(image(100), 1.0)
    watch.acknowledged(1.3)
    assert not watch.acts(number, 1.3 + WINDOW_S - EPSILON)
    assert watch.acts(number, 1.3 + WINDOW_S)


def test_a_cleared_go_bit_is_an_echo_too() -> None:
    watch = Watched()
    number = watch.write(image(0, go=False), 1.0)
    assert watch.observe(shows(0, 1.005)) == image(0)
    assert not watch.acts(number, 1.005)
    assert watch.observe(shows(0, 1.010, go=False)) == image(0, go=False)
    assert watch.acts(number, 1.010)


# -- several writes ----------------------------------------------------------------------------------------


def test_there_and_back_is_not_mistaken_for_never_having_gone() -> None:
    """100, 200, 100: the first 100 must not be taken for the second."""
    watch = Watched(100)
    there = watch.write(image(200), 1.00)
    back = watch.write(image(100), 1.01)
    assert watch.observe(shows(100, 1.015)) == image(100)
    assert not watch.acts(there, 1.015)
    assert not watch.acts(back, 1.015)
    assert watch.observe(shows(200, 1.020)) == image(200)
    assert watch.acts(there, 1.020)
    assert not watch.acts(back, 1.020)
    assert watch.observe(shows(100, 1.025)) == image(100)
    assert watch.acts(back, 1.025)
    assert watch.is_settled(1.025)


def test_there_and_back_written_from_elsewhere_acts_in_order_too() -> None:
    watch = Watched(0)
    numbers = [watch.write(image(position), 1.0 + n / 100) for n, position in enumerate((100, 200, 100))]
    acted = []
    for n, position in enumerate((0, 100, 100, 200, 100)):
        at = 1.04 + n / 100
        assert watch.observe(shows(position, at)) == image(position)
        acted.append([watch.acts(number, at) for number in numbers])
    assert acted == [
        [False, False, False],
        [True, False, False],
        [True, False, False],
        [True, True, False],
        [True, True, True],
    ]


def test_there_and_back_that_never_showed_acts_when_the_window_is_over() -> None:
    watch = Watched(100)
    watch.write(image(200), 1.00)
    back = watch.write(image(100), 1.01)
    assert watch.observe(shows(100, 1.0 + WINDOW_S - EPSILON)) == image(100)
    assert not watch.acts(back, 1.0 + WINDOW_S - EPSILON)
    assert watch.acts(back, 1.01 + WINDOW_S)


def test_a_slow_gripper_that_shows_the_image_before_the_last_is_ours() -> None:
    watch = Watched()
    for n, position in enumerate((10, 20, 30)):
        watch.write(image(position), 1.0 + n / 10)
    assert watch.observe(shows(10, 1.21)) == image(10)
    assert watch.observe(shows(10, 1.22)) == image(10)
    assert watch.observe(shows(20, 1.31)) == image(20)
    assert watch.observe(shows(30, 1.41)) == image(30)


def test_a_gripper_may_skip_an_image() -> None:
    watch = Watched()
    skipped = watch.write(image(10), 1.00)
    last = watch.write(image(20), 1.01)
    assert watch.observe(shows(0, 1.02)) == image(0)
    assert watch.observe(shows(20, 1.03)) == image(20)
    assert watch.acts(last, 1.03)
    assert watch.acts(skipped, 1.03), "a later image acts, so it is not to be waited for any more"


# -- changes without an echo -------------------------------------------------------------------------------


@pytest.mark.parametrize("change", [image(0, speed=200), image(0, force=200)], ids=["speed", "force"])
def test_a_silent_change_acts_after_its_time(change: Request) -> None:
    watch = Watched()
    number = watch.write(change, 1.0)
    watch.observe(shows(0, 1.005))
    assert not watch.acts(number, 1.005)
    assert not watch.acts(number, 1.0 + SILENT_S - EPSILON)
    assert watch.acts(number, 1.0 + SILENT_S)


def test_an_identical_image_acts_at_once() -> None:
    watch = Watched()
    assert watch.acts(watch.write(image(0), 1.0), 1.0)


def test_a_silent_change_behind_a_visible_one_waits_for_it() -> None:
    watch = Watched()
    watch.write(image(100), 1.00)
    silent = watch.write(image(100, speed=200), 1.01)
    assert not watch.acts(silent, 1.01 + SILENT_S)
    watch.observe(shows(100, 1.02 + SILENT_S))
    assert watch.acts(silent, 1.02 + SILENT_S)


def test_a_silent_change_right_behind_a_visible_one_is_given_its_time_after_the_echo() -> None:
    watch = Watched()
    watch.write(image(100), 1.000)
    silent = watch.write(image(100, speed=200), 1.001)
    watch.observe(shows(100, 1.010))
    assert not watch.acts(silent, 1.010)
    assert watch.acts(silent, 1.001 + SILENT_S)


def test_a_visible_change_behind_a_silent_one_shows_that_both_act() -> None:
    watch = Watched()
    silent = watch.write(image(0, speed=200), 1.00)
    watch.write(image(100, speed=200), 1.01)
    watch.observe(shows(100, 1.02))
    assert watch.acts(silent, 1.02)


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
    watch = Watched()
    watch.write(image(50), 0.9)
    assert watch.observe(status) is None


def test_another_client_stays_foreign_until_its_image_is_taken_over() -> None:
    watch = Watched()
    assert watch.observe(shows(77, 1.0)) is None
    assert watch.observe(shows(77, 1.1)) is None
    watch.adopt(image(77), signature_of(image(77)), 1.1)
    assert watch.observe(shows(77, 1.2)) == image(77)
    assert watch.is_settled(1.2)


def test_an_older_image_may_come_back_within_the_window_and_is_foreign_afterwards() -> None:
    watch = Watched(100)
    watch.write(image(200), 1.0)
    watch.observe(shows(200, 1.01))
    assert watch.observe(shows(100, 1.0 + WINDOW_S)) == image(100)
    assert watch.observe(shows(100, 1.0 + WINDOW_S + EPSILON)) is None


def test_the_last_image_is_ours_for_ever() -> None:
    watch = Watched()
    watch.write(image(200), 1.0)
    assert watch.observe(shows(200, 1.01)) == image(200)
    assert watch.observe(shows(200, 1e6)) == image(200)


def test_of_older_images_the_newest_before_the_window_is_kept() -> None:
    watch = Watched()
    watch.write(image(10), 1.0)
    watch.write(image(20), 2.0)
    watch.write(image(30), 2.4)
    watch.observe(shows(30, 2.41))
    # 20 was what the gripper had when the window began; 10 was not.
    assert watch.observe(shows(20, 2.6)) == image(20)
    assert watch.observe(shows(10, 2.6)) is None


def test_a_long_life_does_not_make_the_watch_remember_more() -> None:
    watch = Watched()
    for n in range(2000):
        watch.write(image(n % 256), n / 10)
        assert watch.observe(shows(n % 256, n / 10 + 0.01)) == image(n % 256)
    assert len(watch._written) <= WINDOW_S * 10 + 2


def test_another_client_that_undoes_our_write_before_it_shows_is_noticed_after_the_window() -> None:
    """A client that repeats its own image faster than we poll: ours never shows."""
    watch = Watched(100)
    watch.write(image(200), 1.0)
    assert watch.observe(shows(100, 1.005)) == image(100)
    assert watch.observe(shows(100, 1.0 + WINDOW_S + EPSILON)) is None


# -- a link that comes back --------------------------------------------------------------------------------


def test_a_write_that_was_not_acknowledged_may_still_show_after_a_reconnect() -> None:
    watch = Watched(100)
    watch.writing(image(200), 1.0)
    # The link goes down; 100 still shows when it is back.
    assert watch.observe(shows(100, 1.1)) == image(100)
    watch.adopt(image(100), signature_of(image(100)), 1.1)
    assert not watch.is_settled(1.1)
    assert watch.observe(shows(100, 1.12)) == image(100)
    assert watch.observe(shows(200, 1.15)) == image(200)
    assert watch.is_settled(1.15)


def test_a_write_that_had_arrived_before_the_link_went_down_is_ours() -> None:
    watch = Watched(100)
    watch.writing(image(200), 1.0)
    assert watch.observe(shows(200, 30.0)) == image(200)


def test_a_write_that_was_lost_with_the_link_is_waited_for_in_the_window_only() -> None:
    watch = Watched(100)
    watch.writing(image(200), 1.0)
    watch.adopt(image(100), signature_of(image(100)), 9.0)
    assert not watch.is_settled(9.0 + WINDOW_S - EPSILON)
    assert watch.is_settled(9.0 + WINDOW_S)
    assert watch.observe(shows(100, 20.0)) == image(100)


def test_a_write_that_was_lost_with_the_link_is_foreign_when_it_shows_after_the_window() -> None:
    watch = Watched(100)
    watch.writing(image(200), 1.0)
    watch.adopt(image(100), signature_of(image(100)), 9.0)
    assert watch.observe(shows(100, 9.0 + 2 * WINDOW_S)) == image(100)
    assert watch.observe(shows(200, 9.0 + 3 * WINDOW_S)) is None


def test_what_had_shown_before_an_adoption_is_forgotten() -> None:
    watch = Watched(100)
    watch.write(image(200), 1.0)
    watch.observe(shows(200, 1.01))
    watch.adopt(image(77), signature_of(image(77)), 1.02)
    assert watch.observe(shows(100, 1.03)) is None
    assert watch.observe(shows(200, 1.03)) is None


def test_a_restart_forgets_everything() -> None:
    watch = Watched(100)
    watch.writing(image(200), 1.0)
    watch.restart(image(50), signature_of(image(50)), 1.1)
    assert watch.observe(shows(50, 1.11)) == image(50)
    assert watch.observe(shows(200, 1.12)) is None
    assert watch.observe(shows(100, 1.13)) is None


def test_what_is_shown_may_differ_from_the_image_that_is_taken_for_it() -> None:
    """Simple control: B, C and the scissor echo 0 and are asked for something else."""
    watch = EchoWatch()
    watch.restart(image(80), (True, True, 80, 0, 0, 0), 0.0)
    assert watch.observe(status_of(0x39, echo=(80, 0, 0, 0), at=0.1)) == image(80)


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
    watch, device, now = Watched(), Device(cycle), 0.0
    device.write(watch.last_number, image(0), -1.0)
    written = {watch.last_number: image(0)}
    for pause, request in steps:
        now += pause
        if request is not None:
            number = watch.write(request, now)
            written[number] = request
            device.write(number, request, now)
        status = status_from(device, now)
        shown = watch.observe(status)
        assert shown is not None, "our own write was taken for another client"
        assert signature_of(shown) == signature_of(device.acting(now)[1])
        acting, acts = device.acting(now)
        for number, each in written.items():
            # A silent change is given five cycles of a 100 Hz device; a slower one may need longer.
            silent = signature_of(each) == signature_of(acts)
            if watch.acts(number, now) and not (silent and cycle > SILENT_S):
                assert acting >= number or acts == each
    now += WINDOW_S + cycle
    assert watch.observe(status_from(device, now)) is not None
    assert watch.is_settled(now)


@given(STEPS, st.integers(1, 99))
def test_a_position_that_was_never_written_is_foreign_at_any_time(
    steps: list[tuple[float, Request | None]], foreign: int
) -> None:
    watch, now = Watched(), 0.0
    for pause, request in steps:
        now += pause
        if request is not None:
            watch.write(request, now)
        assert watch.observe(shows(foreign, now)) is None
