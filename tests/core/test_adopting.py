"""Adopting an active gripper, other clients, and a link that comes back."""

from __future__ import annotations

from collections.abc import Mapping

import pytest

from robotiq_async import ConnectionLostError, Finger, MoveSupersededError, NotActivatedError, State
from robotiq_async.enums import AXES
from robotiq_async.wire.request import AxisRequest, Request
from tests.bench import Bench

A, B, C, S = AXES


def image(
    positions: Mapping[Finger, int], *, go: bool = True, individual: bool = True, speed: int = 255
) -> tuple[int, ...]:
    """What another client writes."""
    return Request(
        activate=True,
        go=go,
        individual_fingers=individual,
        individual_scissor=individual,
        axes=tuple(AxisRequest(positions.get(axis, 0), speed, 100) for axis in AXES),
    ).registers


def used_by_another(device_cycle: float = 0.005, speed: int = 128) -> Bench:
    """A gripper that is active when the hand comes."""
    bench = Bench(device_cycle=device_cycle, speed=speed)
    bench.gripper.write(0, Request(activate=True).registers)
    bench.now += 10
    return bench


def travels(bench: Bench) -> dict[Finger, float]:
    return {axis: bench.gripper.travel(axis) for axis in AXES}


def test_adopting_writes_nothing() -> None:
    bench = used_by_another()
    bench.connect()
    assert bench.state is State.RUNNING_IDLE
    bench.run(1.0)
    assert not bench.written


@pytest.mark.parametrize("individual", [True, False])
@pytest.mark.parametrize("into_motion", [0.0, 0.3, 5.0])
@pytest.mark.parametrize("speed", [0, 255])
@pytest.mark.parametrize("objects", [Finger(0), B, A | B | C])
def test_the_first_command_leaves_the_other_axes_what_they_do(
    individual: bool, into_motion: float, speed: int, objects: Finger
) -> None:
    """Whatever the previous client did, only the addressed axis changes its ways."""
    # The hand's own speed is that of the client: speeds have no echo.
    bench, undisturbed = used_by_another(speed=speed), used_by_another()
    for each in (bench, undisturbed):
        if objects:
            each.gripper.place_object(objects, 120)
        positions = dict.fromkeys(AXES, 220) if individual else {A: 220}
        each.gripper.write(0, image(positions, individual=individual, speed=speed))
        each.now += 0.01 + into_motion
    bench.connect()
    # The scissor, so that A, B and C are all un-addressed.
    bench.command(S, position=180)
    bench.run(20)
    undisturbed.now = bench.now
    for axis in (A, B, C):
        assert bench.gripper.position(axis) == pytest.approx(undisturbed.gripper.position(axis), abs=2), axis
        assert bench.gripper.travel(axis) == pytest.approx(undisturbed.gripper.travel(axis), abs=3), axis
    assert bench.latest.contacts & (A | B | C) == objects


def test_a_halted_gripper_is_adopted_where_it_stands() -> None:
    bench = used_by_another()
    bench.gripper.write(0, image(dict.fromkeys(AXES, 255)))
    bench.now += 0.5
    bench.gripper.write(0, image(dict.fromkeys(AXES, 255), go=False))
    bench.now += 0.1
    before = travels(bench)
    bench.connect()
    bench.command(A, position=0)
    bench.run(5)
    after = travels(bench)
    assert {axis: after[axis] - before[axis] for axis in (B, C, S)} == {
        axis: pytest.approx(0, abs=1) for axis in (B, C, S)
    }
    assert bench.gripper.position(A) <= 7


def test_a_halt_does_not_wait_for_an_axis_to_show_its_direction() -> None:
    bench = used_by_another()
    bench.gripper.write(0, image(dict.fromkeys(AXES, 220), speed=0))
    bench.now += 1.0
    bench.connect()
    halted = bench.halt()
    bench.step()
    assert len(bench.written) == 1
    bench.until(lambda: halted.is_told, 0.05)
    assert halted.told == [None]
    assert not bench.gripper.is_moving


# -- another client ----------------------------------------------------------------------------------------


@pytest.fixture
def bench() -> Bench:
    bench = Bench()
    bench.start()
    return bench


def test_our_own_writes_are_never_taken_for_another_client() -> None:
    for device_cycle in (0.0, 0.005, 0.05, 0.2):
        bench = Bench(device_cycle=device_cycle)
        bench.start()
        for value in (100, 200, 100, 0, 100, 200, 255, 0):
            bench.command(A, position=value)
            bench.run(0.02)
        bench.halt()
        bench.run(0.02)
        bench.command(A, position=50)
        bench.run(2.0)
        assert bench.controller.foreign_commands == 0, device_cycle


def test_another_client_is_counted_and_its_requests_are_taken_over(bench: Bench) -> None:
    bench.moved(100)
    bench.gripper.write(0, image({A: 50, B: 200, C: 30, S: 180}))
    bench.run(5.0)
    assert bench.controller.foreign_commands == 1
    before = travels(bench)
    bench.moved(80, A)
    assert {axis: bench.gripper.travel(axis) - before[axis] for axis in (B, C, S)} == {
        axis: pytest.approx(0, abs=1) for axis in (B, C, S)
    }


def test_a_move_that_another_client_takes_over_is_superseded(bench: Bench) -> None:
    _, taken = bench.move(255, A)
    bench.run(0.3)
    bench.gripper.write(0, image({A: 10}))
    bench.run(0.1)
    assert isinstance(taken.error, MoveSupersededError)


def test_a_move_that_another_client_leaves_alone_goes_on(bench: Bench) -> None:
    _, ours = bench.move(255, A)
    bench.run(0.3)
    bench.gripper.write(0, image({A: 255, B: 100, S: 137}))
    bench.until(lambda: ours.is_told)
    assert ours.result.positions[A] >= 240
    assert bench.controller.foreign_commands == 1


def test_our_write_that_shows_after_another_clients_is_what_counts() -> None:
    # Another client's write and ours are on their way together; ours acts last and sends B and C back.
    bench = used_by_another(device_cycle=0.03)
    bench.connect()
    bench.moved(20, S)
    bench.run(1.0)
    bench.gripper.write(0, image({A: 90, B: 90, C: 90, S: 90}))
    ours = bench.command(A, position=200)
    bench.run(1.0)
    bench.until(lambda: not bench.controller.is_moving)
    assert ours.told == [None]
    assert bench.controller.foreign_commands == 1
    before = travels(bench)
    bench.moved(60, B)
    moved = {axis for axis, travel in travels(bench).items() if travel != before[axis]}
    assert moved == {B}


def test_a_reset_by_another_client_is_a_lost_activation(bench: Bench) -> None:
    _, outcome = bench.move(255)
    bench.run(0.3)
    bench.gripper.write(0, Request().registers)
    bench.run(0.1)
    assert bench.state is State.RESET
    assert isinstance(outcome.error, NotActivatedError)
    with pytest.raises(NotActivatedError):
        bench.command(A, position=0)


def test_a_power_cycle_leaves_the_hand_in_reset_and_writes_nothing(bench: Bench) -> None:
    _, outcome = bench.move(255)
    bench.run(0.3)
    writes = len(bench.written)
    bench.gripper.power_cycle()
    bench.run(1.0)
    assert bench.state is State.RESET
    assert isinstance(outcome.error, NotActivatedError)
    assert len(bench.written) == writes
    assert not bench.gripper.is_moving


# -- the link goes down and comes back ---------------------------------------------------------------------


def test_a_lost_link_drops_what_was_not_acknowledged(bench: Bench) -> None:
    pending = bench.command(A, position=200)
    _, move = bench.move(100, B)
    bench.controller.lost(None)
    assert isinstance(pending.error, ConnectionLostError)
    assert isinstance(move.error, ConnectionLostError)
    assert bench.state is State.DISCONNECTED
    with pytest.raises(ConnectionLostError):
        bench.command(A, position=1)
    writes = len(bench.written)
    bench.connect(activate=False)
    bench.run(2.0)
    assert len(bench.written) == writes
    assert bench.state is State.RUNNING_IDLE


def test_a_write_that_arrived_unacknowledged_is_ours_when_it_shows(bench: Bench) -> None:
    lost = bench.command(A, position=200)
    bench.step(answer=False)
    assert isinstance(lost.error, ConnectionLostError)
    bench.now += 0.001  # back before the gripper acts on it
    bench.connect(activate=False)
    bench.run(0.1)
    assert bench.controller.foreign_commands == 0
    assert bench.latest.requested_position(A) == 200
    writes = len(bench.written)
    bench.moved(50, B)
    bench.until(lambda: not bench.controller.is_moving)
    assert bench.gripper.position(A) == pytest.approx(200, abs=2), "B's command keeps what A was asked"
    assert len(bench.written) == writes + 1


def test_a_motion_goes_on_over_a_lost_link_and_is_adopted(bench: Bench) -> None:
    bench.move(255, A)
    bench.run(0.5)
    bench.controller.lost(None)
    bench.now += 0.3
    bench.connect(activate=False)
    assert bench.state is State.RUNNING_IDLE
    bench.moved(100, B)
    bench.until(lambda: not bench.controller.is_moving)
    assert bench.gripper.position(A) >= 240
    assert bench.controller.foreign_commands == 0


def test_a_gripper_that_lost_its_power_is_not_activated_by_a_reconnect(bench: Bench) -> None:
    bench.move(255)
    bench.run(0.5)
    bench.controller.lost(None)
    bench.gripper.power_cycle()
    bench.now += 0.1
    bench.connect(activate=False)
    bench.run(1.0)
    assert bench.state is State.RESET
    assert not bench.gripper.is_moving
