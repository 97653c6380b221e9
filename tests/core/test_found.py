"""Cases that reviews and random runs have found, without a link."""

from __future__ import annotations

from dataclasses import replace

from robotiq_async import Fault, Finger, GripperFaultError, MoveSupersededError, RobotiqStatus, State
from robotiq_async.wire.request import Request
from tests.bench import POLL_S, Bench

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def started() -> Bench:
    bench = Bench()
    bench.start()
    return bench


def reset_and_activated_by_another(bench: Bench) -> None:
    """Register 0 alone, as a pendant writes it: the others keep their content."""
    bench.gripper.write(0, [0x0000])
    bench.run(0.05)
    bench.gripper.write(0, [0x0100])
    bench.until(lambda: bench.state is State.RUNNING_IDLE)


def test_a_lost_command_does_not_come_back_when_the_gripper_was_busy_at_the_reconnect() -> None:
    bench = started()
    bench.moved(50)
    bench.controller.command(A, 250, None, None)
    bench.now += POLL_S
    assert bench.controller.decide(bench.now) is not None  # it never arrives
    bench.controller.lost(None)
    image = Request.from_registers(bench.gripper.request_registers)
    bench.gripper.write(0, replace(image, individual_scissor=False).registers)  # a mode change: gIMC = 2
    bench.now += 0.2
    bench.connect(activate=False)
    bench.until(lambda: bench.state is State.RUNNING_IDLE)
    bench.run(1)
    bench.moved(60, B)
    bench.run(2)
    assert bench.positions()[A] <= 52


def test_after_another_clients_reset_and_activation_no_old_grip_closes_the_fingers() -> None:
    for link_is_down_meanwhile in (False, True):
        bench = started()
        bench.gripper.place_object(Finger.ABC, 150)
        bench.moved(255)
        halted = bench.halt()
        bench.until(lambda: halted.is_told)  # noqa: B023
        bench.gripper.remove_object(Finger.ABC)
        if link_is_down_meanwhile:
            bench.controller.lost(None)
            bench.gripper.write(0, [0x0000])
            bench.now += 0.05
            bench.gripper.write(0, [0x0100])
            bench.now += 10
            bench.connect(activate=False)
        else:
            reset_and_activated_by_another(bench)
        bench.moved(100, S)
        bench.run(3)
        assert bench.positions()[A] < 20


def test_after_a_release_and_another_clients_reset_no_command_releases_again() -> None:
    bench = started()
    bench.moved(100)
    bench.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    bench.run(0.05)
    bench.controller.release()
    bench.until(lambda: bench.state is State.ATR_DONE, 60)
    reset_and_activated_by_another(bench)
    written = len(bench.written)
    bench.moved(60, B)
    assert not any(Request.from_registers(image).release for image in bench.written[written:])


def test_a_fault_at_the_loss_of_the_activation_does_not_activate() -> None:
    bench = started()
    bench.move(200, A)
    bench.run(0.3)
    written = len(bench.written)
    bench.gripper.power_cycle()
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    at = bench.positions()
    bench.run(3)
    assert bench.positions() == at
    assert bench.state is State.RESET
    assert len(bench.written) == written


def test_a_motion_of_ours_does_not_resume_after_a_fault_because_another_client_moved_another_axis() -> None:
    bench = started()
    _, told = bench.move(200, A)
    bench.run(0.3)
    image = Request.from_registers(bench.gripper.request_registers)
    bench.gripper.write(0, image.with_positions({B: 60}).registers)
    bench.run(0.5)
    assert not told.is_told, "A is still ours"
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.5)
    bench.run(0.1)
    assert isinstance(told.error, GripperFaultError)
    at = bench.positions()[A]
    bench.run(5)
    assert bench.positions()[A] <= at + 2
    assert bench.positions()[B] == 60, "what the other client asked goes on"


def test_who_waits_for_a_position_is_told_when_a_move_takes_it_over_and_is_given_up() -> None:
    bench = started()
    waiting, other = bench.command(A, position=50), bench.command(B, position=70)
    move, _ = bench.move(100, A)
    bench.controller.abandon(move)
    bench.run(1)
    assert isinstance(waiting.error, MoveSupersededError)
    assert other.told == [None]
    assert bench.positions()[A] < 10
    bench.until(lambda: not bench.controller.is_moving)
    assert abs(bench.positions()[B] - 70) <= 2


def test_a_hold_survives_a_lost_link() -> None:
    # A hold is a stop: unlike a motion it is not dropped.
    for written in (False, True):
        bench = started()
        move, _ = bench.move(200, A, speed=0)
        bench.run(0.5)
        bench.controller.abandon(move)
        if written:
            bench.now += POLL_S
            assert bench.controller.decide(bench.now) is not None  # and it is lost
        bench.controller.lost(None)
        at = bench.positions()[A]
        bench.now += 0.05
        bench.connect(activate=False)
        assert bench.state is State.RUNNING_IDLE, "nobody has asked for anything"
        bench.run(5)
        # Whether a lost hold arrived is known after a device cycle: a quarter of a second, six counts.
        assert bench.positions()[A] <= at + (8 if written else 4)
        assert bench.state is State.RUNNING_IDLE


def test_a_hold_is_dropped_when_somebody_else_commands_after_the_lost_link() -> None:
    bench = started()
    move, _ = bench.move(200, A, speed=0)
    bench.run(0.5)
    bench.controller.abandon(move)
    bench.controller.lost(None)
    image = Request.from_registers(bench.gripper.request_registers)
    bench.gripper.write(0, image.with_positions({A: 90}).registers)
    bench.now += 0.5
    written = len(bench.written)
    bench.connect(activate=False)
    bench.run(5)
    assert len(bench.written) == written


def test_an_old_reply_that_was_looked_at_late_does_not_make_our_write_anothers() -> None:
    # The loop was held up between the request of a status and its reply: what it shows is as old as that.
    bench = started()
    _, told = bench.move(200, A)
    bench.now += POLL_S
    request = bench.controller.decide(bench.now)
    assert request is not None
    bench.gripper.write(0, request.registers)
    bench.controller.acknowledged(bench.now)
    asked, shown = bench.now, bench.gripper.status_registers()
    bench.now += 0.6
    bench.controller.see(RobotiqStatus(shown, bench.now, 10_000), asked)
    bench.until(lambda: told.is_told)
    assert bench.controller.foreign_commands == 0
    assert abs(told.result.positions[A] - 200) <= 2
