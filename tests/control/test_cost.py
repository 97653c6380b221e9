"""What a cycle of a control loop costs, counted in calls: the same on every machine."""

from __future__ import annotations

import sys
from collections.abc import Callable
from types import FrameType

from robotiq_async.control.requests.writes import WriteHistory
from robotiq_async.values.request import AxisRequest, Request
from robotiq_async.values.status import RobotiqStatus

PERIOD_S = 0.005


def image(position: int) -> Request:
    return Request(activate=True, go=True, axes=(AxisRequest(position, 128, 64),) * 4)


def shows(position: int) -> RobotiqStatus:
    """An active gripper that echoes this."""
    high = position << 8
    return RobotiqStatus((0x3900, position, 0, high, 0, high, 0, 0))


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
    history, now = WriteHistory(), 0.0
    history.restart(image(0), shows(255).echo, now)
    for number in range(writes):
        now += PERIOD_S
        history.writing(image(number % 200), now)
        history.acknowledged(now)

    def look() -> None:
        history.see(shows(250), now)
        assert not history.is_in_doubt

    return calls(look)


def test_a_look_at_a_status_calls_nothing_for_each_write_of_the_last_half_second() -> None:
    assert cost_of_a_look(90) <= cost_of_a_look(10)
