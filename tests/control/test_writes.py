"""Which of the written images a gripper shows, from when on it acts, and what is another client's."""

from __future__ import annotations

import gc
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, NamedTuple

import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from robotiq_async.control.requests.writes import SILENT_S, WINDOW_S, WriteHistory
from robotiq_async.values.request import Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import EPSILON, image, shows
from tests.register_words import status_of


class History(WriteHistory):
    """Of a gripper that shows a position at first; it answers and acknowledges at once."""

    def __init__(self, position: int = 0) -> None:
        super().__init__()
        self.restart(image(position), image(position).echo, 0.0)

    def look(self, status: RobotiqStatus) -> Request | None:
        return self.see(status, status.timestamp)

    def write(self, request: Request, at: float) -> int:
        number = self.writing(request, at)
        self.acknowledged(at)
        return number


# -- what happens one after another ------------------------------------------------------------------------

Event = Callable[[History, float], object]


def writes(position: int, **options: Any) -> Event:
    return lambda history, at: history.write(image(position, **options), at)


def sends(position: int) -> Event:
    """A write that is not acknowledged yet."""
    return lambda history, at: history.writing(image(position), at)


def acknowledged(history: History, at: float) -> None:
    history.acknowledged(at)


def link_lost(history: History, _: float) -> None:
    history.lost()


def time_passes(_history: History, _at: float) -> None:
    pass


def ours(position: int, *, go: bool = True, **options: Any) -> Event:
    """A status that shows an image of ours."""

    def look(history: History, at: float) -> None:
        assert history.look(shows(position, at, go=go)) == image(position, go=go, **options), at

    return look


def foreign(position: int) -> Event:
    """A status that shows what another client wrote."""

    def look(history: History, at: float) -> None:
        assert history.look(shows(position, at)) is None, at

    return look


def adopts(position: int) -> Event:
    return lambda history, at: history.adopt(image(position), image(position).echo, at)


def restarts(position: int) -> Event:
    return lambda history, at: history.restart(image(position), image(position).echo, at)


class At(NamedTuple):
    """What happens at a time, how many of the last images do not act yet, and whether one may never act."""

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
            *(At(1.0 + WINDOW_S, ours(100)), At(1.0 + WINDOW_S + EPSILON, foreign(100)), At(1e6, ours(200))),
        ],
    ),
    "of older images the newest before the window is kept": (
        0,
        [
            *(At(1.0, writes(10), 1), At(2.0, writes(20), 1), At(2.4, writes(30), 2), At(2.41, ours(30))),
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
            *(At(1.0, sends(200), 1), At(1.1, restarts(50)), At(1.11, ours(50))),
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
    # A write that was lost with the link is in doubt until it shows, or as long as the window.
    "an acknowledged write is not lost": (100, [At(1.0, writes(200), 1), At(1.0, link_lost, 1)]),
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
            *(*LOST, At(9.0, adopts(100), 1, True), At(9.0 + WINDOW_S - EPSILON, time_passes, 1, True)),
            *(At(9.0 + WINDOW_S, ours(100), 0, True), At(9.0 + WINDOW_S + EPSILON, ours(100))),
            *(At(20.0, ours(100)), At(20.0, foreign(200))),
        ],
    ),
}


@pytest.mark.parametrize("name", STORIES)
def test_a_history_of_writes(name: str) -> None:
    position, story = STORIES[name]
    history = History(position)
    for at, event, waiting, in_doubt in story:
        event(history, at)
        numbers = range(1, history.last_number + 1)
        waits = [number for number in numbers if not history.acts(number, at)]
        assert (waits, history.is_in_doubt) == ([*numbers[len(numbers) - waiting :]], in_doubt), at


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
    history.write(image(50), 0.9)
    assert history.look(status) is None


def test_the_images_are_numbered_one_by_one() -> None:
    history = History()
    before = history.last_number
    assert history.write(image(1), 0.1) == history.last_number == before + 1
    assert history.write(image(2), 0.2) == history.last_number == before + 2


def test_a_long_life_does_not_make_the_history_remember_more() -> None:
    history = History()
    for n in range(2000):
        history.write(image(n % 256), n / 10)
        assert history.look(shows(n % 256, n / 10 + 0.01)) == image(n % 256)
    assert len(history._writes) <= WINDOW_S * 10 + 2


def test_an_adopted_image_may_differ_from_its_echo() -> None:
    """Simple control: B, C and the scissor echo 0 and are asked for something else."""
    history = WriteHistory()
    history.lost()
    assert not history.is_in_doubt, "nothing was written"
    history.restart(image(80), (True, True, 80, 0, 0, 0), 0.0)
    assert history.see(status_of(0x39, echo=(80, 0, 0, 0)), 0.1) == image(80)


def test_an_old_status_that_is_looked_at_late_is_compared_with_what_was_written_then() -> None:
    """What it shows is as old as its request, however late the reply was looked at."""
    history = History(100)
    history.write(image(200), 1.0)
    assert history.see(shows(100, 1.7), 1.0) == image(100)
    assert not history.acts(history.last_number, 1.0)


# -- what cannot be told apart -----------------------------------------------------------------------------


@pytest.mark.parametrize("arrives", [True, False])
def test_of_images_that_show_alike_the_newest_that_has_arrived_is_the_one_in_force(arrives: bool) -> None:
    """The speed and force of one that may not have arrived have no echo that could tell."""
    history = History(100)
    shown = history.look(shows(100, 0.9))
    assert shown is not None
    history.writing(image(100, speed=7), 1.0)
    if arrives:
        history.acknowledged(1.0)
    else:
        history.lost()
    assert history.newest_that_shows_like(shown) == (image(100, speed=7) if arrives else image(100))
    assert history.newest_that_shows_like(image(5)) == image(5), "an image that was never written"


def test_images_look_alike_until_one_of_them_asks_for_something_that_is_echoed() -> None:
    history = History(100)
    assert history.all_look_alike
    history.write(image(100, speed=7), 1.0)
    assert history.all_look_alike
    history.write(image(101, speed=7), 1.1)
    assert not history.all_look_alike


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
        shown = history.look(status)
        assert shown is not None, "our own write was taken for another client"
        assert shown.echo == device.acting(now)[1].echo
        acting, acts = device.acting(now)
        for number, each in written.items():
            # A silent change is given five cycles of a 100 Hz device; a slower one may need longer.
            silent = each.echo == acts.echo
            if history.acts(number, now) and not (silent and cycle > SILENT_S):
                assert acting >= number or acts == each
    now += WINDOW_S + cycle
    assert history.look(status_from(device, now)) is not None
    assert history.acts(history.last_number, now)


@given(STEPS, st.integers(1, 99))
def test_a_position_that_was_never_written_is_foreign_at_any_time(
    steps: list[tuple[float, Request | None]], foreign: int
) -> None:
    history, now = History(), 0.0
    for pause, request in steps:
        now += pause
        if request is not None:
            history.write(request, now)
        assert history.look(shows(foreign, now)) is None


# -- what a look costs, in calls: the same on every machine ------------------------------------------------


def calls(what: Callable[[], object]) -> int:
    """How many functions of Python are called."""
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
