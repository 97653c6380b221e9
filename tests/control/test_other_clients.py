"""Other clients: their requests before the hand came, and beside it."""

from __future__ import annotations

import gc

import pytest

from robotiq_async import Fault, Finger, MoveSupersededError, NotActivatedError, RobotiqStatus, State
from robotiq_async.control.entry import Entry
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request
from tests.control.other_client import image, used_by_another
from tests.control.scan import POLL_S, Scan, started

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


@pytest.mark.parametrize(
    ("into_motion", "objects", "individual", "speed"),
    [
        *((0.0, Finger(0), True, 60), (0.0, B, False, 255), (0.0, A | B | C, True, 255)),
        *((0.3, Finger(0), False, 255), (0.3, B, True, 60), (0.3, A | B | C, False, 60)),
        *((3.0, Finger(0), True, 255), (3.0, B, False, 60), (3.0, A | B | C, True, 60)),
    ],
)  # each pair of values once
def test_the_first_command_leaves_the_other_axes_what_they_do(
    into_motion: float, objects: Finger, individual: bool, speed: int
) -> None:
    """Whatever the previous client did, only the addressed axis changes its ways."""
    # The hand's own speed is that of the client: speeds have no echo.
    scan, undisturbed = used_by_another(speed=speed), used_by_another()
    for each in (scan, undisturbed):
        if objects:
            each.gripper.place_object(objects, 120)
        positions = dict.fromkeys(THREE_FINGER.axes, 220) if individual else {A: 220}
        each.gripper.write(0, image(positions, individual=individual, speed=speed))
        each.now += 0.01 + into_motion
    scan.connect()
    # The scissor, so that A, B and C are all un-addressed.
    scan.command(S, position=180)
    scan.run(3 if speed == 255 else 6)
    undisturbed.now = scan.now
    for axis in (A, B, C):
        assert scan.gripper.position(axis) == pytest.approx(undisturbed.gripper.position(axis), abs=2), axis
        assert scan.gripper.travel(axis) == pytest.approx(undisturbed.gripper.travel(axis), abs=3), axis
    assert scan.latest.contacts & (A | B | C) == objects


def test_a_halted_gripper_is_adopted_where_it_stands() -> None:
    scan = used_by_another()
    scan.gripper.write(0, image(dict.fromkeys(THREE_FINGER.axes, 255)))
    scan.now += 0.5
    scan.gripper.write(0, image(dict.fromkeys(THREE_FINGER.axes, 255), go=False))
    scan.now += 0.1
    before = scan.travels()
    scan.connect()
    scan.command(A, position=0)
    scan.run(5)
    after = scan.travels()
    assert {axis: after[axis] - before[axis] for axis in (B, C, S)} == {
        axis: pytest.approx(0, abs=1) for axis in (B, C, S)
    }
    assert scan.gripper.position(A) <= 7


# -- beside the hand -------------------------------------------------------------------------------------


def test_our_own_writes_are_never_taken_for_another_client() -> None:
    for device_cycle in (0.0, 0.005, 0.05, 0.2):
        scan = started(device_cycle)
        for value in (100, 200, 100, 0, 100, 200, 255, 0):
            scan.command(A, position=value)
            scan.run(0.02)
        scan.halt()
        scan.run(0.02)
        scan.command(A, position=50)
        scan.run(2.0)
        assert scan.controller.foreign_commands == 0, device_cycle


def test_an_old_reply_that_was_looked_at_late_does_not_make_our_write_anothers(scan: Scan) -> None:
    # The loop was held up between the request of a status and its reply: it is as old as that.
    _, outcome = scan.move(200, A)
    scan.now += POLL_S
    request = scan.controller.decide(scan.now)
    assert request is not None
    scan.gripper.write(0, request.registers)
    scan.controller.acknowledged(scan.now)
    asked, shown = scan.now, scan.gripper.status_registers()
    scan.now += 0.6
    scan.controller.see(RobotiqStatus(shown, scan.now, 10_000), asked)
    scan.until(lambda: outcome.is_answered)
    assert scan.controller.foreign_commands == 0
    assert abs(outcome.result.positions[A] - 200) <= 2


def test_another_client_is_counted_and_its_requests_are_taken_over(scan: Scan) -> None:
    scan.moved(100)
    scan.gripper.write(0, image({A: 50, B: 200, C: 30, S: 180}))
    scan.run(5.0)
    assert scan.controller.foreign_commands == 1
    before = scan.travels()
    scan.moved(80, A)
    assert {axis: scan.gripper.travel(axis) - before[axis] for axis in (B, C, S)} == {
        axis: pytest.approx(0, abs=1) for axis in (B, C, S)
    }


def test_another_client_that_keeps_commanding_is_warned_of_once_a_second(
    scan: Scan, caplog: pytest.LogCaptureFixture
) -> None:
    scan.run(1.0)
    for position in range(100, 125):
        scan.gripper.write(0, image({A: position}))
        scan.run(0.1)
    assert scan.controller.foreign_commands == 25
    assert caplog.text.count("another client commands the gripper") == 3


def test_a_move_that_another_client_takes_over_is_superseded(scan: Scan) -> None:
    _, taken = scan.move(255, A)
    scan.run(0.3)
    scan.gripper.write(0, image({A: 10}))
    scan.run(0.1)
    assert isinstance(taken.error, MoveSupersededError)


def test_a_move_that_another_client_leaves_alone_goes_on(scan: Scan) -> None:
    _, ours = scan.move(255, A)
    scan.run(0.3)
    scan.gripper.write(0, image({A: 255, B: 100, S: 137}))
    scan.until(lambda: ours.is_answered)
    assert ours.result.positions[A] >= 240
    assert scan.controller.foreign_commands == 1


def test_our_write_that_shows_after_another_clients_is_what_counts() -> None:
    # Another client's write and ours are on their way together; ours acts last and sends B and C back.
    scan = used_by_another(device_cycle=0.03)
    scan.connect()
    scan.moved(20, S)
    scan.run(1.0)
    scan.gripper.write(0, image({A: 90, B: 90, C: 90, S: 90}))
    ours = scan.command(A, position=200)
    scan.run(1.0)
    scan.until(lambda: not scan.controller.is_moving)
    assert ours.answers == [None]
    assert scan.controller.foreign_commands == 1
    before = scan.travels()
    scan.moved(60, B)
    moved = {axis for axis, travel in scan.travels().items() if travel != before[axis]}
    assert moved == {B}


ORDERS = pytest.mark.parametrize(
    ("device_cycle", "before_ours", "between"),
    [
        *((0.02, 0.0, 0.005), (0.02, 0.005, 0.01), (0.02, 0.01, 0.005)),
        *((0.05, 0.0, 0.01), (0.05, 0.005, 0.005), (0.05, 0.01, 0.01)),
        *((0.2, 0.0, 0.005), (0.2, 0.005, 0.01), (0.2, 0.01, 0.005)),
    ],
)
"""Slow cycles, and the times from the other client's write to ours and from that to our second: each pair."""


@ORDERS
def test_a_halt_that_another_client_overtakes_stays_a_halt(
    device_cycle: float, before_ours: float, between: float
) -> None:
    """Two writes of ours act after the other client's: the newer one, a halt, is what the gripper has."""
    scan = started(device_cycle)
    scan.moved(7)
    scan.run(1.0)
    scan.gripper.write(0, image({A: 90}))
    scan.run(before_ours)
    scan.command(A, position=250)
    scan.run(between)
    scan.halt()
    scan.run(1.0)
    assert not scan.gripper.is_moving
    assert not scan.controller.is_moving
    before = scan.travels()
    scan.command(B, position=60)
    scan.run(3.0)
    assert {axis for axis, travel in scan.travels().items() if travel != before[axis]} == {B}


@ORDERS
def test_two_writes_that_another_client_overtakes_leave_what_they_have_asked(
    device_cycle: float, before_ours: float, between: float
) -> None:
    scan = started(device_cycle)
    scan.moved(60)
    scan.run(1.0)
    scan.gripper.write(0, image({A: 60, B: 150, C: 60, S: 137}))
    scan.run(before_ours)
    scan.command(A, position=200)
    scan.run(between)
    scan.command(C, position=30)
    scan.run(3.0)
    before = scan.travels()
    scan.moved(80, A)
    assert {axis for axis, travel in scan.travels().items() if travel != before[axis]} == {A}


def test_a_pending_hold_does_not_stop_a_client_that_took_over(scan: Scan) -> None:
    move, _ = scan.move(200, A, speed=0)
    scan.run(0.5)
    image = Request.from_registers(scan.gripper.request_registers)
    scan.gripper.write(0, image.with_positions({A: 90}).registers)
    scan.now += 0.02
    scan.controller.abandon(move)
    scan.see()
    assert scan.controller.foreign_commands == 1
    scan.run(10)
    assert scan.positions()[A] == 90


def test_a_power_cycle_leaves_the_hand_in_reset_and_writes_nothing(scan: Scan) -> None:
    _, outcome = scan.move(255)
    scan.run(0.3)
    writes = len(scan.written)
    scan.gripper.power_cycle()
    scan.run(1.0)
    assert scan.state is State.RESET
    assert isinstance(outcome.error, NotActivatedError)
    assert len(scan.written) == writes
    assert not scan.gripper.is_moving


def test_an_activation_by_crossing_a_reset_is_taken_back_on_a_link_that_returns_in_it() -> None:
    """The reset began before the status that brought the link back was shown. Random lives found it."""
    scan = started(device_cycle=0.03)
    scan.run(0.2)
    scan.gripper.write(0, [0])
    scan.command(Finger.A, 100)
    scan.until(lambda: scan.state is State.WF_ACTIVATION)
    scan.blink(away=0.4)
    assert (State.DISCONNECTED, State.WF_ACTIVATION) in [each[:2] for each in scan.transitions]
    scan.until(lambda: scan.state is State.RESET)
    assert not scan.gripper.is_moving


def test_a_loop_goes_on_after_a_fault_with_no_more_entries_than_before() -> None:
    """A write showed in the fault, where no axis comes to rest: it was kept for ever, and all after it."""
    scan = Scan(device_cycle=0.02, speed=20)
    scan.start()

    def entries() -> int:
        return sum(isinstance(each, Entry) for each in gc.get_objects())

    def loop(seconds: float) -> int:
        for number in range(round(seconds / POLL_S)):
            scan.command(A, position=number % 256)
            scan.step()
        return entries()

    before = loop(2.0)
    scan.gripper.inject_fault(Fault.SCISSOR_INTERFERENCE)
    scan.run(0.04)
    scan.gripper.write(0, image(dict.fromkeys(THREE_FINGER.axes, 200), speed=20))
    scan.run(0.03)
    scan.gripper.clear_faults()
    scan.until(lambda: scan.state is State.RUNNING_IDLE)
    assert scan.controller.foreign_commands == 1
    assert loop(4.0) <= before + 10
