"""The state for people of an axis that never had a request: never that it moves."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from robotiq_async import RobotiqStatus, State
from robotiq_async.cli.output.lines import status_line
from robotiq_async.cli.output.tables import print_status
from robotiq_async.cli.tui.widgets import STILL, Axes
from robotiq_async.ros2.translation.diagnosis import diagnose, status_text
from robotiq_async.tools.recording.payloads import reading_fields
from robotiq_async.tools.web.page.mirror import HandMirror
from robotiq_async.tools.web.page.widgets.words import axis_words
from robotiq_async.values.model import THREE_FINGER
from tests.fake_hand import FakeHand
from tests.register_words import status_of

NEVER_ASKED = status_of(0x31, 0x00)
"""Active; gDT is 0 for every axis, which alone would read as moving."""
MOVING = status_of(0x39, 0x00)


def hand_with(status: RobotiqStatus) -> FakeHand:
    hand = FakeHand()
    hand.fake._state, hand.fake._last = State.RUNNING_IDLE, status
    return hand


def on_the_page(status: RobotiqStatus) -> str:
    hand = HandMirror(0, "sim://", State.RUNNING_IDLE, status)
    return " ".join(axis_words(hand, axis) for axis in THREE_FINGER.axes)


def on_the_screen(status: RobotiqStatus) -> str:
    axes = Axes(THREE_FINGER)
    for _ in range(STILL + 1):
        axes.show(status, dict.fromkeys(THREE_FINGER.axes, 0))
    return " ".join(str(axes._does(axis)) for axis in THREE_FINGER.axes)


READ: dict[str, Callable[[RobotiqStatus], str]] = {
    "repr": repr,
    "as_dict": lambda status: str(status.as_dict()),
    "a line": lambda status: status_line(status.as_dict()),
    "status --json": lambda status: str(reading_fields(hand_with(status))),
    "the screen": on_the_screen,
    "the page": on_the_page,
    "diagnostics of ROS": lambda status: str(diagnose(hand_with(status), 0.0)[1].values),
    "the topic of ROS": lambda status: status_text(hand_with(status), takes_commands=True),
}


def says_moving(words: str) -> bool:
    return "IN_MOTION" in words or "moving" in words.replace("is_moving", "")


@pytest.mark.parametrize("where", READ)
def test_it_moves_only_when_it_was_asked_to(where: str) -> None:
    assert not says_moving(READ[where](NEVER_ASKED))
    assert says_moving(READ[where](MOVING))


def test_the_table(capsys: pytest.CaptureFixture[str]) -> None:
    print_status(hand_with(NEVER_ASKED))
    assert not says_moving(capsys.readouterr().out.replace("not moving", ""))
    print_status(hand_with(MOVING))
    assert capsys.readouterr().out.count("IN_MOTION") == 4
