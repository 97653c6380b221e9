"""Each row of the contract's table, against the simulator's Modbus server."""

from __future__ import annotations

import asyncio
import contextlib
import itertools

import pytest

from robotiq_async import (
    CLOSED,
    OPEN,
    ActivationTimeoutError,
    ConnectFailedError,
    Fault,
    Finger,
    GripperFaultError,
    InvalidStateError,
    MoveSupersededError,
    MoveTimeoutError,
    NotActivatedError,
    NotStartedError,
    ObjectStatus,
    RobotiqHand,
    RobotiqStatus,
    State,
    StateTimeoutError,
    Transition,
)
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from robotiq_async.wire.request import Request

pytestmark = pytest.mark.virtual_time

A, B, C, S = Finger.A, Finger.B, Finger.C, Finger.SCISSOR


def last_write(server: SimulatorServer) -> Request:
    return Request.from_registers(server.gripper.writes[-1].registers)


def test_constructing_opens_nothing_and_needs_no_loop() -> None:
    hand = RobotiqHand("tcp://192.0.2.1")
    assert hand.state is State.DISCONNECTED
    assert "192.0.2.1:502" in repr(hand)


async def test_start_activates_a_reset_gripper(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    await hand.start()
    try:
        assert hand.state is State.RUNNING_IDLE
        assert hand.is_activated
        assert not hand.is_reset
        assert not hand.is_moving
    finally:
        await hand.stop()
    assert hand.state is State.SHUTDOWN


async def test_start_without_activation_stays_in_reset_and_writes_nothing(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    await hand.start(activate=False)
    assert hand.state is State.RESET
    assert hand.is_reset
    with pytest.raises(NotActivatedError):
        await hand.move(100)
    with pytest.raises(NotActivatedError):
        hand.command(position=3)
    await hand.activate()
    assert hand.state is State.RUNNING_IDLE
    await hand.stop()


async def test_only_looking_leaves_no_trace(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    await hand.start(activate=False)
    await hand.stop(halt=False)
    assert not server.gripper.writes


async def test_stop_clears_go_and_keeps_the_activation(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        await hand.set_position(255)
    image = last_write(server)
    assert (image.activate, image.go) == (True, False)
    assert not server.gripper.is_moving
    await hand.stop()


async def test_a_hand_may_be_started_again(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    for _ in range(3):
        await hand.start()
        sequence = hand.status.sequence
        await hand.move(20, A)
        assert hand.status.sequence > sequence
        await hand.stop()
    assert hand.statistics.foreign_commands == 0


async def test_start_twice_is_refused(hand: RobotiqHand) -> None:
    with pytest.raises(InvalidStateError) as caught:
        await hand.start()
    assert caught.value.state is State.RUNNING_IDLE
    assert hand.state is State.RUNNING_IDLE


async def test_set_position_returns_when_acknowledged(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_position(200, A)
    assert last_write(server).position(A) == 200
    assert hand.is_moving


async def test_set_speed_and_force(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_speed(7, A | S)
    await hand.set_force(9, B)
    image = last_write(server)
    assert [axis.speed for axis in image.axes] == [7, 128, 128, 7]
    assert [axis.force for axis in image.axes] == [64, 9, 64, 64]
    assert not image.go


async def test_integer_masks_are_as_good_as_fingers(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_speed(5, 10)
    assert [axis.speed for axis in last_write(server).axes] == [128, 5, 128, 5]
    result = await hand.move(50, 1)
    assert set(result.outcomes) == {A}


async def test_command_merges_until_the_next_poll(hand: RobotiqHand, server: SimulatorServer) -> None:
    writes = len(server.gripper.writes)
    for value in range(50):
        hand.command(position=value)
    hand.command(A, speed=255)
    assert hand.is_moving
    assert hand.state is State.RUNNING_CC
    await hand.wait_for_state(State.RUNNING_IDLE)
    assert len(server.gripper.writes) == writes + 1
    assert last_write(server).position(A) == 49


async def test_move_open_and_close(hand: RobotiqHand) -> None:
    closed = await hand.close(speed=255)
    assert closed.outcomes == dict.fromkeys((A, B, C), ObjectStatus.AT_POSITION)
    assert all(position >= 240 for position in closed.positions.values())
    opened = await hand.open(A, speed=255)
    assert opened.positions[A] <= 7
    assert (OPEN, CLOSED) == (0, 255)


async def test_move_with_an_object(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.place_object(Finger.ABC, position=150)
    result = await hand.move(255)
    assert result.object_detected
    assert result.contacts == Finger.ABC
    assert result.status.contacts == Finger.ABC
    assert hand.status.position(A) == pytest.approx(150, abs=3)


async def test_move_times_out_and_holds(hand: RobotiqHand, server: SimulatorServer) -> None:
    with pytest.raises(MoveTimeoutError) as caught:
        await hand.move(255, speed=0, timeout=0.2)
    assert isinstance(caught.value, TimeoutError)
    assert isinstance(caught.value.status, RobotiqStatus)
    async for _ in hand.statuses():
        if not hand.is_moving:
            break
    assert not server.gripper.is_moving
    assert hand.status.position(A) < 200


async def test_halt(hand: RobotiqHand, server: SimulatorServer) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    await hand.halt()
    assert not hand.is_moving
    assert not server.gripper.is_moving
    with pytest.raises(MoveSupersededError):
        await moving
    await hand.move(30, A)


async def test_hold(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.place_object(B, position=20)
    moves = [asyncio.create_task(hand.move(255, axis, speed=0)) for axis in (A, B, C)]
    assert (await moves[1]).contacts == B
    await hand.hold(A | B)
    with pytest.raises(MoveSupersededError, match="hold"):
        await moves[0]
    assert last_write(server).position(A) < 255
    assert [last_write(server).position(axis) for axis in (B, C)] == [255, 255], "a grip, and a motion"
    await hand.hold()
    with pytest.raises(MoveSupersededError):
        await moves[2]
    assert last_write(server).position(B) == 255
    async for _ in hand.statuses():
        if not hand.is_moving:
            break
    writes = len(server.gripper.writes)
    await hand.hold()
    assert len(server.gripper.writes) == writes, "nothing moves"
    await hand.reset()
    await hand.hold()
    assert hand.state is State.RESET


async def test_status_before_the_first_one(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    with pytest.raises(NotStartedError):
        hand.status  # noqa: B018
    for what in ("is_moving", "is_activated", "is_reset"):
        with pytest.raises(NotStartedError):
            getattr(hand, what)
    stops = (hand.hold(), hand.halt(), hand.reset())
    for call in (hand.move(3), hand.set_position(3), *stops, hand.atr(), hand.activate()):
        with pytest.raises(NotStartedError):
            await call
    with pytest.raises(NotStartedError):
        hand.command(position=3)


async def test_release_reset_activate(hand: RobotiqHand, server: SimulatorServer) -> None:
    with pytest.raises(InvalidStateError) as caught:
        await hand.atr()
    assert caught.value.allowed == {State.FAULT}
    server.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    await hand.wait_for_state(State.FAULT)
    with pytest.raises(GripperFaultError) as fault:
        await hand.activate()
    assert fault.value.fault is Fault.SCISSOR_BLOCKED
    await hand.atr()
    assert hand.state is State.ATR_DONE
    with pytest.raises(GripperFaultError):
        await hand.set_position(3)
    await hand.reset()
    assert hand.state is State.RESET
    assert hand.is_reset
    await hand.activate()
    await hand.activate()
    assert hand.state is State.RUNNING_IDLE


@pytest.mark.parametrize("fault", [Fault.SCISSOR_BLOCKED, Fault.ACTIVATION_FAULT, 0x0C])
async def test_recover_from_a_major_fault(hand: RobotiqHand, server: SimulatorServer, fault: int) -> None:
    server.gripper.inject_fault(fault)
    await hand.wait_for_state(State.FAULT)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    await hand.move(100, A)


async def test_recover_from_a_minor_fault_waits_and_keeps_the_activation(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 2.0)
    await hand.wait_for_state(State.FAULT)
    writes = len(server.gripper.writes)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE
    assert len(server.gripper.writes) == writes


async def test_recover_from_a_release(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.emergency_release()
    await hand.wait_for_state(State.FAULT)
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE


async def test_recover_gives_up_in_time(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY)
    await hand.wait_for_state(State.FAULT)
    with pytest.raises(StateTimeoutError):
        await hand.recover(timeout=0.1)


async def test_recover_while_running_does_nothing(hand: RobotiqHand, server: SimulatorServer) -> None:
    writes = len(server.gripper.writes)
    await hand.recover()
    assert len(server.gripper.writes) == writes


async def test_wait_for_state(hand: RobotiqHand) -> None:
    assert await hand.wait_for_state(State.FAULT, State.RUNNING_IDLE) is State.RUNNING_IDLE
    with pytest.raises(StateTimeoutError):
        await hand.wait_for_state(State.FAULT, timeout=0.02)
    waiting = asyncio.create_task(hand.wait_for_state(State.RUNNING_CC))
    await asyncio.sleep(0)
    hand.command(position=5)
    assert await waiting is State.RUNNING_CC


async def test_waiting_for_a_state_ends_with_stop(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
        shutdown = asyncio.create_task(hand.wait_for_state(State.SHUTDOWN))
        await asyncio.sleep(0)
    with pytest.raises(NotStartedError):
        await waiting
    assert await shutdown is State.SHUTDOWN
    with pytest.raises(NotStartedError):
        await hand.wait_for_state(State.RUNNING_IDLE)


async def test_transitions_opened_before_start_lose_nothing_and_end_after_stop(
    server: SimulatorServer,
) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.transitions()

    async def collect() -> list[Transition]:
        return [transition async for transition in stream]

    collecting = asyncio.create_task(collect())
    async with hand:
        for _ in range(20):
            await hand.set_position(20)
    seen = await collecting
    assert seen[0].source is State.DISCONNECTED
    assert seen[-1].target is State.SHUTDOWN
    assert all(before.target is after.source for before, after in itertools.pairwise(seen))
    assert [each.target for each in seen].count(State.RUNNING_CC) == 20
    stamps = [each.timestamp for each in seen]
    assert stamps == sorted(stamps)


async def test_statuses_opened_before_start_wait_and_end_after_stop(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    stream = hand.statuses(buffer=100_000)

    async def collect() -> list[int]:
        return [status.sequence async for status in stream]

    collecting = asyncio.create_task(collect())
    await asyncio.sleep(0)
    async with hand:
        await hand.move(50)
    sequence = await collecting
    assert sequence == list(range(len(sequence)))
    assert stream.missed == 0


async def test_a_slow_reader_costs_only_itself(hand: RobotiqHand) -> None:
    slow, fast = hand.statuses(), hand.statuses()
    first = await anext(slow)
    latest = first
    for _ in range(20):
        latest = await anext(fast)
    assert (await anext(slow)).sequence == latest.sequence
    assert slow.missed == latest.sequence - first.sequence - 1


async def test_statuses_with_aclosing(hand: RobotiqHand) -> None:
    async with contextlib.aclosing(hand.statuses()) as statuses:
        async for status in statuses:
            assert status is hand.status
            break
    with pytest.raises(StopAsyncIteration):
        await anext(statuses)


async def test_statistics(hand: RobotiqHand) -> None:
    await hand.move(60)
    statuses = hand.statuses()
    for _ in range(20):
        await anext(statuses)
    statistics = hand.statistics
    assert statistics.polls > 20
    assert statistics.writes >= 2
    assert statistics.reconnects == statistics.foreign_commands == 0
    assert 0.001 < statistics.period_p50 < 0.05
    assert 0 < statistics.round_trip_p50 <= statistics.round_trip_p99


async def test_activation_fault_of_its_own_fails_the_start(server: SimulatorServer) -> None:
    server.gripper.fail_activation = True
    hand = RobotiqHand(server.address)
    with pytest.raises(GripperFaultError) as caught:
        await hand.start()
    assert caught.value.fault is Fault.ACTIVATION_FAULT
    assert hand.state is State.SHUTDOWN
    await hand.start()
    assert hand.state is State.FAULT, "a fault that is there already is not start()'s business"
    await hand.recover()
    await hand.stop()


async def test_start_on_a_released_gripper_returns_in_atr_done(server: SimulatorServer) -> None:
    async with RobotiqHand(server.address) as hand:
        server.gripper.emergency_release()
        await hand.wait_for_state(State.ATR_DONE, timeout=20)
    async with RobotiqHand(server.address) as hand:
        assert hand.state is State.ATR_DONE
        await hand.recover()


async def test_an_activation_that_takes_too_long_fails_the_start_and_is_taken_back() -> None:
    async with SimulatorServer() as server:
        hand = RobotiqHand(server.address, activation_timeout=0.2)
        with pytest.raises(ActivationTimeoutError):
            await hand.start()
        assert not server.gripper.is_moving
        assert not last_write(server).activate


async def test_nobody_there() -> None:
    server = SimulatorServer()
    await server.start()
    address = server.address
    await server.stop()
    hand = RobotiqHand(address)
    with pytest.raises(ConnectFailedError) as caught:
        await hand.start()
    assert caught.value.address == address
    assert address in str(caught.value)
    assert hand.state is State.SHUTDOWN


async def test_sim_address_runs_over_real_modbus_tcp() -> None:
    hand = RobotiqHand("sim://")
    await hand.start(activate=False)
    assert hand.state is State.RESET
    await hand.stop()
    other = RobotiqHand("sim://")
    await asyncio.gather(hand.start(activate=False), other.start(activate=False))
    await asyncio.gather(hand.stop(), other.stop())


async def test_two_hands_on_one_address(hand: RobotiqHand, server: SimulatorServer) -> None:
    for spelled in (server.address, server.address.removeprefix("tcp://"), f"localhost:{server.port}"):
        other = RobotiqHand(spelled)
        with pytest.raises(InvalidStateError):
            await other.start()
    await hand.stop()
    async with RobotiqHand(server.address):
        pass


async def test_many_hands_readers_and_movers_side_by_side() -> None:
    async with (
        SimulatorServer(SimulatedGripper(speedup=20)) as one,
        SimulatorServer(SimulatedGripper(speedup=20)) as two,
        RobotiqHand(one.address) as left,
        RobotiqHand(two.address) as right,
        asyncio.TaskGroup() as group,
    ):

        async def read(hand: RobotiqHand) -> None:
            seen = 0
            async for _ in hand.statuses():
                seen += 1
                if seen == 50:
                    return

        async def mover(hand: RobotiqHand, finger: Finger, position: int) -> None:
            with contextlib.suppress(MoveSupersededError):
                await hand.move(position, finger)

        for hand in (left, right):
            for _ in range(5):
                group.create_task(read(hand))
            for index in range(10):
                group.create_task(mover(hand, (A, B, C, S)[index % 4], 40 + index))
