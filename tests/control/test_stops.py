"""A stop that gets one status after another: its writes, their repetition, and its end."""

from __future__ import annotations

from dataclasses import replace
from typing import NamedTuple

import pytest

from robotiq_async.control.ledger import WINDOW_S, Ledger
from robotiq_async.control.stops import Ended, Stop
from robotiq_async.values.enums import NO_AXES, Mode
from robotiq_async.values.enums import StopLevel as Level
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus
from tests.control.histories import BUSY, FAULTY, READY, RELEASED, RESET, RUNNING
from tests.control.scan import first_request
from tests.register_words import status_of

IMAGE = Request(
    activate=True,
    go=True,
    mode=Mode.PINCH,
    axes=(AxisRequest(10, 1, 5), AxisRequest(20, 2, 6), AxisRequest(30, 3, 7), AxisRequest(40, 4, 8)),
)
ECHO = (10, 20, 30, 40)
HERE = (1, 2, 3, 4)

BEFORE = status_of(0x39, 0xC0, echo=ECHO, position=HERE)
STOPPED = status_of(0x31, 0xC0, echo=ECHO)


class Again(NamedTuple):
    """A status after which the stop is written again: it should be echoed by now, and may be forgotten."""

    status: RobotiqStatus


class Stopping:
    """A stop of a gripper that follows IMAGE. Each status comes when the write acts by its age."""

    def __init__(self, level: Level, *, is_early: bool = False) -> None:
        self.ledger, self.now = Ledger(first_request(0, 0)), 0.0
        self.ledger.update(BEFORE, 0.0)
        self.ledger.adopt(BEFORE)
        self.ledger.write(IMAGE, NO_AXES, 0.0)
        self.ledger.acknowledge(0.0)
        self.ledger.update(BEFORE, 2 * WINDOW_S)
        self.now = 2 * WINDOW_S
        self.stop = Stop(level)
        image = self.stop.next_image(self.ledger, BEFORE)
        assert isinstance(image, Request)
        self.image = image
        self.write(image, is_early=is_early)

    def write(self, image: Request, *, is_early: bool = False) -> None:
        self.stop.written(self.ledger.write(image, NO_AXES, self.now, is_early=is_early))
        self.ledger.acknowledge(self.now)

    def see(self, status: RobotiqStatus, after: float = WINDOW_S) -> bool:
        """Whether the stop is reached."""
        self.now += after
        self.ledger.update(status, self.now)
        return self.stop.see(self.ledger, status) is None

    def again(self, status: RobotiqStatus) -> bool:
        image = self.stop.next_image(self.ledger, status)
        if isinstance(image, Request):
            assert image == self.image
            self.write(image)
        return image is not None


@pytest.mark.parametrize(
    ("level", "expected"),
    [
        (Level.RESET, replace(IMAGE, activate=False, go=False)),
        (Level.HALT, replace(IMAGE, go=False)),
        (Level.SHUTDOWN, replace(IMAGE, go=False)),
    ],
)
def test_a_stop_changes_these_bits_of_the_image(level: Level, expected: Request) -> None:
    """A reset also requests the present positions: nothing may start when rGTO rises again."""
    if level is Level.RESET:
        axes = zip(IMAGE.axes, HERE, strict=True)
        expected = replace(expected, axes=tuple(replace(axis, position=at) for axis, at in axes))
    assert Stopping(level).image == expected


@pytest.mark.parametrize("shown", [READY, RUNNING, BUSY, FAULTY, RELEASED, RESET])
def test_a_reset_begins_for_any_status(shown: RobotiqStatus) -> None:
    """An emergency is not weighed."""
    ledger = Ledger(first_request(0, 0))
    ledger.update(shown, 0.0)
    ledger.adopt(shown)
    image = Stop(Level.RESET).next_image(ledger, shown)
    assert isinstance(image, Request)
    assert not image.activate


def test_a_shutdown_with_nothing_to_stop_writes_nothing() -> None:
    ledger = Ledger(first_request(0, 0))
    ledger.update(READY, 0.0)
    ledger.adopt(READY)
    assert Stop(Level.SHUTDOWN).next_image(ledger, READY) == Ended()


@pytest.mark.parametrize(
    ("level", "shown", "end"),
    [
        # Only gACT = 0 and gIMC = 0 end a reset.
        (Level.RESET, [status_of(0x30), status_of(0x10), Again(RUNNING), Again(READY)], RESET),
        # A fault may outlast it.
        *(
            (Level.RESET, [Again(status_of(0x01, fault=code)), status_of(0x00, fault=code)], RESET)
            for code in (0x09, 0x0B, 0x0D, 0x0E, 0x0F, 0x0C)
        ),
        (Level.RESET, [Again(status_of(0x01, fault=0x0B)), Again(status_of(0x01))], RESET),  # a release
        # The whole last image is echoed; gGTO = 0 alone is not enough.
        (Level.SHUTDOWN, [Again(status_of(0x39, 0xC0, echo=ECHO))], STOPPED),
        *(
            (
                Level.SHUTDOWN,
                [Again(status_of(0x31, echo=echo)), Again(status_of(0x39, echo=ECHO))],
                STOPPED,
            )
            for echo in ((11, 20, 30, 40), (10, 21, 30, 40), (10, 20, 31, 40), (10, 20, 30, 41), (0,) * 4)
        ),
        (Level.SHUTDOWN, [status_of(0x30, echo=ECHO)], STOPPED),
        # Its rACT would activate a gripper that was reset.
        (Level.SHUTDOWN, [status_of(0x30), status_of(0x10)], RESET),
        (Level.HALT, [], STOPPED),
        # Its caller has an answer after the second, whatever the status.
        (Level.HALT, [Again(BEFORE)], BEFORE),
    ],
)
def test_a_stop_waits_and_ends(level: Level, shown: list[RobotiqStatus | Again], end: RobotiqStatus) -> None:
    stopping = Stopping(level)
    for each in shown:
        status = each.status if isinstance(each, Again) else each
        assert not stopping.see(status), each
        assert stopping.again(status) is isinstance(each, Again), each
    assert stopping.see(end)


@pytest.mark.parametrize(("level", "end"), [(Level.RESET, RESET), (Level.SHUTDOWN, RESET)])
def test_what_shows_before_the_write_acts_ends_nothing(level: Level, end: RobotiqStatus) -> None:
    """It may be from before another client's activation, or from before our own."""
    stopping = Stopping(level)
    assert not stopping.see(end, after=0.01)
    assert not stopping.again(end), "it has its time"
    assert stopping.see(end)


@pytest.mark.parametrize("level", [Level.HALT, Level.SHUTDOWN, Level.RESET])
def test_a_stop_that_came_early_is_written_again_whatever_shows(level: Level) -> None:
    """A gripper may echo it and forget it."""
    end = RESET if level is Level.RESET else STOPPED
    stopping = Stopping(level, is_early=True)
    assert not stopping.see(end)
    assert stopping.again(end)
    assert stopping.see(end)
