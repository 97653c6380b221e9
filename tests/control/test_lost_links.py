"""A link that goes down and comes back: nothing is replayed, nothing is undone, and a stop is not lost."""

from __future__ import annotations

from dataclasses import replace

import pytest

from robotiq_async import Finger, State
from robotiq_async.control.requests.pending import Command
from robotiq_async.values.request import AxisRequest, Request
from tests.control.other_client import activated_by_another
from tests.control.scan import POLL_S, Scan, started
from tests.control.stories import tell

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR

MOVING = "started, move A 200 speed=0, run 0.5"
GIVEN_UP = f"{MOVING}, abandon 1"
STORIES = {
    "what was not acknowledged is dropped": "started, note, command A 200, move B 100, lose, 1 lost, 2 lost, "
    "state DISCONNECTED, refused lost, connect, run 2, written 0, state RUNNING_IDLE",
    # The link is back before the gripper acts on it, and the command to B keeps what A was asked.
    "a write that arrived is ours when it shows": "started, command A 200, step unanswered, 1 lost, "
    "back 0.001, run 0.1, foreign 0, A echoes 200, note, moved B 50, until still, A at 200, written 1",
    "a motion goes on and is adopted": "started, move A 255, run 0.5, lose, back 0.3, state RUNNING_IDLE, "
    "moved B 100, until still, A at 241, foreign 0",
    "a gripper that lost its power is not activated": "started, move ABC 255, run 0.5, lose, power-cycle, "
    "back 0.1, run 1, state RESET, rests",
    # A hold is a stop: unlike a motion it is not dropped.
    "a hold survives": f"{GIVEN_UP}, lose, note, back 0.05, state RUNNING_IDLE, run 5, A went 4, "
    "state RUNNING_IDLE",
    # Whether it arrived is known after a device cycle: a quarter of a second, six counts.
    "a hold that was written survives": f"{GIVEN_UP}, undelivered, lose, note, back 0.05, "
    "state RUNNING_IDLE, run 5, A went 8, state RUNNING_IDLE",
    **{
        f"a hold outlives what has replaced it and was lost: {what}": f"{GIVEN_UP}, {what}, note, blink, "
        "run 10, A went 4"
        for what in ("halt", "command A 10")
    },
    "a hold is dropped when somebody else commands": f"{GIVEN_UP}, lose, beside A=90, later 0.5, note, "
    "connect, run 5, written 0",
    # A policy may say that it is activated.
    "a hold does not outlive an activation": f"{GIVEN_UP}, lose, power-cycle, later 0.1, connect activate, "
    "until state RUNNING_IDLE, command A 200, run 0.5, blink, run 10, A at 200",
    # Its caller never saw the error, and knows nothing of a motion that goes on.
    "cancelled as the link was lost": f"{MOVING}, lose, 1 lost, abandon 1 unseen, note, back 0.05, run 10, "
    "A went 4",
    "cancelled then, and the link is back": f"{MOVING}, lose, 1 lost, back 0.05, abandon 1 unseen, note, "
    "run 10, A went 4",
    "given up after the error was seen": f"{MOVING}, lose, abandon 1, back 0.05, run 10, A at 200",
}


@pytest.mark.parametrize("name", STORIES)
def test_a_story(name: str) -> None:
    tell(STORIES[name])


@pytest.mark.parametrize("device_cycle", [0.005, 0.03, 0.1, 0.2])
@pytest.mark.parametrize("arrived", [True, False])
def test_a_command_after_a_lost_acknowledgement_waits_until_it_is_known_what_acts(
    device_cycle: float, arrived: bool
) -> None:
    scan = started(device_cycle)
    scan.command(S, position=32)
    scan.run(0.6)
    scan.command(S, position=200)
    if arrived:
        scan.step(answer=False)
    else:
        scan.now += POLL_S
        assert scan.controller.decide(scan.now) is not None
        scan.controller.lost(None)
    scan.now += 0.001
    scan.connect(activate=False)  # before the gripper acts on it, if it got it
    pending = scan.command(A, position=50)
    began = scan.now
    scan.until(lambda: pending.is_told)
    assert scan.now - began < 0.5
    scan.until(lambda: not scan.controller.is_moving)
    assert scan.positions()[S] == pytest.approx(200 if arrived else 32, abs=2)
    assert scan.positions()[A] == pytest.approx(50, abs=2)
    positions = [Request.from_registers(image).position(S) for image in scan.written]
    assert positions[-1] == (200 if arrived else 32)


def test_a_lost_command_does_not_come_back_when_the_gripper_was_busy_at_the_reconnect(scan: Scan) -> None:
    scan.moved(50)
    scan.controller.command(Command(A, 250))
    scan.now += POLL_S
    assert scan.controller.decide(scan.now) is not None  # it never arrives
    scan.controller.lost(None)
    image = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, replace(image, individual_scissor=False).registers)  # a mode change: gIMC = 2
    scan.come_back(0.2)
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    scan.run(1)
    scan.moved(60, B)
    scan.run(2)
    assert scan.positions()[A] <= 52


def test_what_was_adopted_is_not_ours_after_a_blink_of_the_link() -> None:
    scan = activated_by_another()
    scan.gripper.place_object(Finger.ABC, 150)
    simple = (AxisRequest(200, 128, 64), AxisRequest(), AxisRequest(), AxisRequest(137))
    scan.gripper.write(0, Request(activate=True, go=True, individual_fingers=False, axes=simple).registers)
    scan.now += 0.5
    scan.connect(activate=False)  # while the fingers close, all of them by A's registers
    scan.run(8)
    scan.blink()
    scan.run(1)
    scan.moved(100, S)
    scan.run(3)
    assert scan.positions()[B] == 150, "B still holds"


# -- what has no echo ------------------------------------------------------------------------------------


@pytest.mark.parametrize("moved_before", [False, True])
def test_an_acknowledged_speed_survives_a_blink_of_the_link(moved_before: bool) -> None:
    scan = started(device_cycle=0.1)
    if moved_before:
        scan.command(B, position=120)
        scan.step()
    scan.command(B, speed=77, force=33)
    scan.step()
    scan.blink()
    scan.run(0.3)
    scan.command(A, position=60)
    scan.run(0.6)
    image = Request.from_registers(scan.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (77, 33)


def test_a_speed_that_was_not_acknowledged_is_not_taken_for_the_axis_s_own(scan: Scan) -> None:
    scan.command(B, speed=77, force=33)
    scan.step(answer=False)
    scan.come_back(0.05)
    scan.run(0.3)
    scan.command(A, position=60)
    scan.run(0.6)
    image = Request.from_registers(scan.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (128, 64)
