"""Halts: they go at once, stop everything, and end when the gripper shows it."""

from __future__ import annotations

import pytest

from robotiq_async import Finger
from robotiq_async.values.model import THREE_FINGER
from tests.control.other_client import image, used_by_another
from tests.control.stories import tell

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

STORIES = {
    "it stops everything and ends moves": "started, move ABC 255, run 0.5, halt, 1 superseded, until told 2, "
    "2 told, rests, no go",
    "a command after it moves only its own axes": "started, move ABC 255, run 0.5, halt, move A 100, "
    "run 0.01, note, until told 3, run 1, BCS went 1, A at 100",
    "a command waits until a slow gripper has stopped": "started 0.1, move ABC 255 speed=255, run 0.5, halt, "
    "move A 0, until no go, note, until told 3, BC went 1",
    "what was not sent yet is dropped": "started, note, command A 200, halt, 1 superseded, run 0.5, A went 1",
    "in reset it has nothing to do": "new, connect, halt, 1 told, run 0.05, written 0",
    **{
        f"in fault {code} it is told while that lasts, {begun}": f"{begun}, inject {code}, run 0.1, "
        f"state FAULT, halt, until told {number} 0.7, {number} told, no go"
        for code in (9, 10, 14)
        for begun, number in (("started", 1), ("started, move ABC 255, run 0.5", 2))
    },
    "it outlives a fault in the same poll": "adopted, halt, inject 12 0.1, see, state FAULT, note, run 10, "
    "1 told, A went 4",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


def test_a_halt_does_not_wait_for_an_axis_to_show_its_direction() -> None:
    scan = used_by_another()
    scan.gripper.write(0, image(dict.fromkeys(THREE_FINGER.axes, 220), speed=0))
    scan.now += 1.0
    scan.connect()
    halted = scan.halt()
    scan.step()
    assert len(scan.written) == 1
    scan.until(lambda: halted.is_told, 0.05)
    assert halted.told == [None]
    assert not scan.gripper.is_moving
