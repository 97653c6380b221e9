"""Grips: what they survive, and when they end."""

from __future__ import annotations

import pytest

from robotiq_async import Finger
from tests.control.other_client import reset_and_activated_by_another
from tests.control.scan import Scan, started
from tests.control.stories import tell

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

STORIES = {
    "a halt and a command to another axis": "started, place B 60, moved B 255, halt, run 0.1, moved A 100, "
    "B asked 255, B closing",
    "a minor fault": "started, place A 60, moved A 255, note, inject 9 0.5, run 1, state RUNNING_IDLE, "
    "A echoes 255, written 0",
    "a halt and a blink of the link": "started, place B 150, moved B 255, halt, until told 2, blink, "
    "run 0.1, moved A 60, B echoes 255",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


def test_a_grip_that_is_not_taken_up_again_is_told(caplog: pytest.LogCaptureFixture) -> None:
    """The first program let go of rGTO; who comes next cannot know what its fingers were asked."""
    first = started()
    first.gripper.place_object(A | B | C, 150)
    first.moved(255)
    first.stop()
    scan = Scan(after=first)
    scan.connect()
    scan.moved(60, A | S)
    (said,) = caplog.messages
    assert said.startswith("B|C in contact while rGTO was clear")
    assert scan.latest.requested_position(B) == scan.latest.position(B) == 150
    assert not scan.gripper.grips
    scan.moved(80, A)
    assert caplog.messages == [said], "once"


def test_a_grip_that_is_taken_up_again_needs_no_word(scan: Scan, caplog: pytest.LogCaptureFixture) -> None:
    scan.gripper.place_object(B, 60)
    scan.moved(255, B)
    scan.halted()
    assert not scan.gripper.grips
    scan.moved(100, A)
    assert scan.gripper.grips == B
    assert not caplog.messages


def test_a_grip_that_is_somewhere_else_by_now_is_none(scan: Scan) -> None:
    scan.gripper.place_object(Finger.ABC, 150)
    scan.moved(255)
    scan.halted()
    scan.gripper.remove_object(Finger.ABC)
    scan.gripper.write(0, [0x0000])  # all of this while the loop is held up
    scan.now += 0.05
    scan.gripper.write(0, [0x0100])
    scan.now += 6
    scan.step()
    scan.moved(100, S)
    scan.run(3)
    assert scan.positions()[A] < 20


def test_a_motion_that_was_halted_does_not_come_back_because_the_axis_had_gripped() -> None:
    scan = started(device_cycle=0.02)
    scan.gripper.place_object(A, 150)
    scan.moved(255, A)
    scan.command(A, position=20)
    scan.step()
    scan.gripper.device_cycle = 0  # both writes fall into one tick of the device
    scan.halted()
    scan.moved(60, B)
    scan.run(3)
    assert scan.positions()[A] == 150


def test_after_another_clients_reset_and_activation_no_old_grip_closes_the_fingers() -> None:
    for link_is_down_meanwhile in (False, True):
        scan = started()
        scan.gripper.place_object(Finger.ABC, 150)
        scan.moved(255)
        scan.halted()
        scan.gripper.remove_object(Finger.ABC)
        if link_is_down_meanwhile:
            scan.controller.lost(None)
            scan.gripper.write(0, [0x0000])
            scan.now += 0.05
            scan.gripper.write(0, [0x0100])
            scan.come_back(10)
        else:
            reset_and_activated_by_another(scan)
        scan.moved(100, S)
        scan.run(3)
        assert scan.positions()[A] < 20
