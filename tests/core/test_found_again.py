"""Cases that a second review has found: whose request an axis has, and which stop must not be lost."""

from __future__ import annotations

import pytest

from robotiq_async import Fault, Finger, GripperFaultError, Mode, State
from robotiq_async.wire.request import AxisRequest, Request
from tests.bench import POLL_S, Bench

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def started(device_cycle: float = 0.005) -> Bench:
    bench = Bench(device_cycle=device_cycle)
    bench.start()
    return bench


def asked(position: int, speed: int = 128) -> tuple[AxisRequest, ...]:
    return (AxisRequest(position, speed, 64),) * 3 + (AxisRequest(137, speed, 64),)


def going_to(position: int, speed: int = 128) -> tuple[int, ...]:
    """What another client writes to move the fingers."""
    return Request(activate=True, go=True, axes=asked(position, speed)).registers


def active() -> Bench:
    """A gripper that another client has activated; the hand has not come yet."""
    bench = Bench()
    bench.gripper.write(0, [0x0100])
    bench.now += 10
    return bench


def moved_by_another() -> Bench:
    """The hand has adopted a gripper whose fingers are on their way for another client."""
    bench = active()
    bench.gripper.write(0, going_to(200, speed=0))
    bench.now += 0.5
    bench.connect(activate=False)
    bench.run(0.5)
    return bench


def blink(bench: Bench) -> None:
    """The link is lost and comes back."""
    bench.controller.lost(None)
    bench.now += 0.05
    bench.connect(activate=False)


def stop(bench: Bench) -> None:
    bench.controller.stop()
    bench.controller.shut_down()
    while bench.controller.machine.is_busy:
        bench.step()


# -- whose request it is -------------------------------------------------------------------------------


def test_what_was_adopted_is_not_ours_after_a_blink_of_the_link() -> None:
    bench = active()
    bench.gripper.place_object(Finger.ABC, 150)
    simple = (AxisRequest(200, 128, 64), AxisRequest(), AxisRequest(), AxisRequest(137))
    bench.gripper.write(0, Request(activate=True, go=True, individual_fingers=False, axes=simple).registers)
    bench.now += 0.5
    bench.connect(activate=False)  # while the fingers close, all of them by A's registers
    bench.run(8)
    blink(bench)
    bench.run(1)
    bench.moved(100, S)
    bench.run(3)
    assert bench.positions()[B] == 150, "B still holds"


def test_a_fault_does_not_stop_the_motion_of_another_client_after_a_blink_of_the_link() -> None:
    bench = moved_by_another()
    blink(bench)
    bench.run(0.3)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.1)
    bench.run(15)
    assert not bench.written
    assert bench.positions()[A] == 200


@pytest.mark.parametrize("how", ["position", "speed"])
def test_another_client_that_writes_during_our_activation_is_noticed_at_its_end(how: str) -> None:
    bench = Bench()
    bench.gripper.place_object(Finger.ABC, 150)
    bench.connect()
    bench.run(1)
    bench.gripper.write(0, going_to(200))
    bench.until(lambda: bench.state is State.RUNNING_IDLE)
    assert bench.controller.foreign_commands == 1
    bench.run(5)  # its fingers grip
    if how == "position":
        bench.moved(180, B)
        bench.run(3)
        assert bench.positions()[A] == 150
    else:
        bench.command(B, speed=10)
        bench.run(1)
        assert bench.latest.go_echo


def test_stop_leaves_the_activation_of_others_alone() -> None:
    bench = active()
    pinch = Request(activate=True, go=True, individual_scissor=False, mode=Mode.PINCH, axes=asked(100))
    bench.gripper.write(0, pinch.registers)
    bench.now += 0.2
    bench.connect(activate=False)
    bench.run(0.05)
    assert bench.state is State.WF_ACTIVATION, "it changes its mode"
    stop(bench)
    assert bench.status().activation_echo


def test_stop_does_not_take_back_an_activation_that_never_arrived_and_that_others_have_begun_since() -> None:
    bench = Bench()
    bench.connect(activate=False)
    bench.controller.activate()
    bench.now += POLL_S
    assert bench.controller.decide(bench.now) is not None  # it never arrives
    blink(bench)
    bench.run(60)
    assert bench.state is State.RESET
    bench.gripper.write(0, [0x0100])
    bench.run(0.5)
    stop(bench)
    assert bench.status().activation_echo


def test_an_activation_is_called_off_when_others_have_activated_meanwhile() -> None:
    bench = Bench()
    bench.connect(activate=False)
    bench.gripper.place_object(Finger.ABC, 150)
    bench.gripper.write(0, [0x0100])
    bench.now += 6
    bench.gripper.write(0, going_to(255))
    bench.now += 3
    bench.controller.activate()
    bench.step()  # what is begun is decided on what the gripper shows now
    assert bench.state is State.RUNNING_IDLE
    bench.run(1)
    assert not bench.written
    assert bench.latest.contacts == Finger.ABC


def test_a_pending_hold_does_not_stop_who_has_taken_over() -> None:
    bench = started()
    move, _ = bench.move(200, A, speed=0)
    bench.run(0.5)
    image = Request.from_registers(bench.gripper.request_registers)
    bench.gripper.write(0, image.with_positions({A: 90}).registers)
    bench.now += 0.02
    bench.controller.abandon(move)
    bench.controller.see(bench.status())
    assert bench.controller.foreign_commands == 1
    bench.run(10)
    assert bench.positions()[A] == 90


@pytest.mark.parametrize("device_cycle", [0.005, 0.03, 0.1, 0.2])
@pytest.mark.parametrize("arrived", [True, False])
def test_a_command_after_a_lost_acknowledgement_waits_until_it_is_known_what_acts(
    device_cycle: float, arrived: bool
) -> None:
    bench = started(device_cycle)
    bench.command(S, position=32)
    bench.run(0.6)
    bench.command(S, position=200)
    if arrived:
        bench.step(answer=False)
    else:
        bench.now += POLL_S
        assert bench.controller.decide(bench.now) is not None
        bench.controller.lost(None)
    bench.now += 0.001
    bench.connect(activate=False)  # before the gripper acts on it, if it got it
    pending = bench.command(A, position=50)
    began = bench.now
    bench.until(lambda: pending.is_told)
    assert bench.now - began < 0.5
    bench.until(lambda: not bench.controller.is_moving)
    assert bench.positions()[S] == pytest.approx(200 if arrived else 32, abs=2)
    assert bench.positions()[A] == pytest.approx(50, abs=2)
    positions = [Request.from_registers(image).position(S) for image in bench.written]
    assert positions[-1] == (200 if arrived else 32)


# -- grips ---------------------------------------------------------------------------------------------


def test_a_motion_that_was_halted_does_not_come_back_because_the_axis_had_gripped() -> None:
    bench = started(device_cycle=0.02)
    bench.gripper.place_object(A, 150)
    bench.moved(255, A)
    bench.command(A, position=20)
    bench.step()
    bench.gripper.device_cycle = 0  # both writes fall into one tick of the device
    halted = bench.halt()
    bench.until(lambda: halted.is_told)
    bench.moved(60, B)
    bench.run(3)
    assert bench.positions()[A] == 150


def test_a_grip_that_is_somewhere_else_by_now_is_none() -> None:
    bench = started()
    bench.gripper.place_object(Finger.ABC, 150)
    bench.moved(255)
    halted = bench.halt()
    bench.until(lambda: halted.is_told)
    bench.gripper.remove_object(Finger.ABC)
    bench.gripper.write(0, [0x0000])  # all of this while the loop is held up
    bench.now += 0.05
    bench.gripper.write(0, [0x0100])
    bench.now += 6
    bench.step()
    bench.moved(100, S)
    bench.run(3)
    assert bench.positions()[A] < 20


def test_a_halted_grip_survives_a_blink_of_the_link() -> None:
    bench = started()
    bench.gripper.place_object(B, 150)
    bench.moved(255, B)
    halted = bench.halt()
    bench.until(lambda: halted.is_told)
    blink(bench)
    bench.run(0.1)
    bench.moved(60, A)
    assert bench.latest.requested_position(B) == 255


def test_more_force_is_waited_for_also_on_a_slow_device() -> None:
    bench = started(device_cycle=0.1)
    bench.gripper.place_object(A, 150, soft=50)
    bench.moved(255, A, force=0)
    result = bench.moved(255, A, force=255)
    bench.run(3)
    assert abs(result.positions[A] - bench.positions()[A]) <= 2


# -- stops that must not be lost -----------------------------------------------------------------------


@pytest.mark.parametrize("how", ["halt", "command"])
def test_a_hold_outlives_what_has_replaced_it_and_was_lost(how: str) -> None:
    bench = started()
    move, _ = bench.move(200, A, speed=0)
    bench.run(0.5)
    bench.controller.abandon(move)
    if how == "halt":
        bench.halt()
    else:
        bench.command(A, position=10)
    at = bench.positions()[A]
    blink(bench)
    bench.run(10)
    assert abs(bench.positions()[A] - at) <= 4


def test_a_halt_outlives_a_fault_in_the_same_poll() -> None:
    bench = moved_by_another()
    halted = bench.halt()
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 0.1)
    bench.controller.see(bench.status())
    assert bench.state is State.FAULT
    at = bench.positions()[A]
    bench.run(10)
    assert halted.told == [None]
    assert bench.positions()[A] <= at + 4


def test_nothing_resumes_when_a_fault_clears_that_began_while_the_link_was_down() -> None:
    bench = started()
    bench.move(200, A, speed=0)
    bench.run(0.5)
    bench.controller.lost(None)
    bench.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2)
    bench.now += 0.1
    bench.connect(activate=False)
    assert bench.state is State.FAULT
    with pytest.raises(GripperFaultError):
        bench.command(B, position=3)
    at = bench.positions()[A]
    bench.run(10)
    assert bench.positions()[A] <= at + 4


def test_a_lost_hold_does_not_outlive_an_activation() -> None:
    bench = started()
    move, _ = bench.move(200, A, speed=0)
    bench.run(0.3)
    bench.controller.abandon(move)
    bench.controller.lost(None)
    bench.gripper.power_cycle()
    bench.now += 0.1
    bench.connect(activate=True)  # as a policy may say
    bench.until(lambda: bench.state is State.RUNNING_IDLE)
    bench.command(A, position=200)
    bench.run(0.5)
    blink(bench)
    bench.run(10)
    assert bench.positions()[A] >= 198


# -- what has no echo ----------------------------------------------------------------------------------


@pytest.mark.parametrize("moved_before", [False, True])
def test_an_acknowledged_speed_survives_a_blink_of_the_link(moved_before: bool) -> None:
    bench = started(device_cycle=0.1)
    if moved_before:
        bench.command(B, position=120)
        bench.step()
    bench.command(B, speed=77, force=33)
    bench.step()
    blink(bench)
    bench.run(0.3)
    bench.command(A, position=60)
    bench.run(0.6)
    image = Request.from_registers(bench.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (77, 33)


def test_a_speed_that_was_not_acknowledged_is_not_taken_for_the_axis_s_own() -> None:
    bench = started()
    bench.command(B, speed=77, force=33)
    bench.step(answer=False)
    bench.now += 0.05
    bench.connect(activate=False)
    bench.run(0.3)
    bench.command(A, position=60)
    bench.run(0.6)
    image = Request.from_registers(bench.written[-1])
    assert (image.axes[1].speed, image.axes[1].force) == (128, 64)
