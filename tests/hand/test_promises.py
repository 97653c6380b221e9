"""The promises of the contract, each broken link and each deadline against the simulator's server."""

from __future__ import annotations

import asyncio
import contextlib
import logging
import os
import resource
import sys
import time
from asyncio.subprocess import PIPE
from collections.abc import AsyncIterator, Iterator
from pathlib import Path

import anyio
import pytest
import pytest_asyncio

from robotiq_async import (
    ConnectFailedError,
    ConnectionLostError,
    Fault,
    Finger,
    GripperFaultError,
    MoveSupersededError,
    NotActivatedError,
    NotStartedError,
    ReconnectPolicy,
    RobotiqHand,
    State,
)
from robotiq_async.enums import AXES
from robotiq_async.simulator import SimulatorServer, parse_troubles
from robotiq_async.wire.request import AxisRequest, Request

ROOT = Path(__file__).parents[2]
A, B, C, S = AXES


async def settled(hand: RobotiqHand) -> None:
    """Wait until nothing moves any more."""
    async for _ in hand.statuses():
        if hand.state is State.RUNNING_IDLE and not hand.is_moving:
            return


def travels(server: SimulatorServer) -> dict[Finger, float]:
    return {axis: server.gripper.travel(axis) for axis in AXES}


# -- 1: never blocks, every await ends ----------------------------------------------------------------------


@pytest.fixture(params=[0, 1])
def few_files(request: pytest.FixtureRequest) -> Iterator[None]:
    """This process can open no more files, or one more."""
    limits = resource.getrlimit(resource.RLIMIT_NOFILE)
    resource.setrlimit(resource.RLIMIT_NOFILE, (256, limits[1]))
    opened = []
    try:
        with contextlib.suppress(OSError):
            while True:
                opened.append(os.open(os.devnull, os.O_RDONLY))
        for _ in range(request.param):
            os.close(opened.pop())
        yield
    finally:
        for each in opened:
            os.close(each)
        resource.setrlimit(resource.RLIMIT_NOFILE, limits)


async def test_an_address_may_say_how_fast_its_gripper_is_and_what_is_in_its_way() -> None:
    async with RobotiqHand("sim://?speedup=50&object=150") as hand:
        result = await hand.close(speed=255)
        assert result.contacts == Finger.ABC
        assert result.duration < 1
        for axis in (Finger.A, Finger.B, Finger.C):
            assert result.positions[axis] == pytest.approx(150, abs=5)
        assert hand.address.startswith("sim://?speedup=50&object=150#")


async def test_without_a_free_descriptor_a_simulated_gripper_says_so(few_files: None) -> None:
    hand = RobotiqHand("sim://")
    # From Python 3.13 on asyncio keeps the reason to itself when there is none for its first socket.
    reason = r"cannot connect to .*: .*(Too many open files|could not bind)"
    with pytest.raises(ConnectFailedError, match=reason) as caught:
        await hand.start()
    assert caught.value.address
    assert hand.state is State.SHUTDOWN


async def test_a_write_fails_within_a_second_on_a_silent_gripper(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.replies.silence()
    began = time.monotonic()
    with pytest.raises(ConnectionLostError):
        await hand.set_position(200)
    assert time.monotonic() - began < 1.0


async def test_start_on_a_silent_gripper_ends_within_five_seconds(server: SimulatorServer) -> None:
    server.replies.silence()
    began = time.monotonic()
    with pytest.raises(ConnectFailedError):
        await RobotiqHand(server.address).start()
    assert time.monotonic() - began < 5.0


@pytest.mark.parametrize("what", ["drop on write once", "silence once", "exception on write once", "reset"])
async def test_a_stop_that_was_not_heard_is_sent_again(
    hand: RobotiqHand, server: SimulatorServer, what: str
) -> None:
    await hand.set_position(255)
    await until_moving(server, hand)
    (trouble,) = parse_troubles(what)
    await server.fault_injector.begin(trouble)
    await hand.stop()
    assert not server.gripper.is_moving
    assert not Request.from_registers(server.gripper.request_registers).go


@pytest.mark.parametrize("what", ["silence", "refuse"])
async def test_stop_ends_within_two_seconds_on_a_dead_link(
    hand: RobotiqHand, server: SimulatorServer, what: str
) -> None:
    if what == "silence":
        server.replies.silence()
    else:
        server.refuse()
        server.cut()
        await hand.wait_for_state(State.DISCONNECTED)
    began = time.monotonic()
    await hand.stop()
    assert time.monotonic() - began < 2.0
    assert hand.state is State.SHUTDOWN


# -- 2 and 3 are in tests/control; here over the wire -------------------------------------------------------


async def test_the_first_exchange_is_a_read_and_adopting_writes_nothing(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.move(200)
    await hand.stop()
    writes, before = len(server.gripper.writes), travels(server)
    async with RobotiqHand(server.address) as other:
        assert other.state is State.RUNNING_IDLE
        async for status in other.statuses():
            if status.sequence > 20:
                break
        assert len(server.gripper.writes) == writes
        assert travels(server) == before
        await other.move(150, A)
        after = travels(server)
    assert [after[axis] - before[axis] for axis in (B, C, S)] == [0, 0, 0]


# -- 4 and 5: no replay, no activation ----------------------------------------------------------------------


async def test_a_command_that_was_not_acknowledged_is_never_sent_again(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.replies.drop(1_000_000)
    with pytest.raises(ConnectionLostError):
        await hand.set_position(200, A)
    sent = [
        write for write in server.gripper.writes if Request.from_registers(write.registers).position(A) == 200
    ]
    assert len(sent) <= 1
    server.replies.normal()
    await hand.wait_for_state(State.RUNNING_IDLE)
    writes = len(server.gripper.writes)
    await settled(hand)
    assert len(server.gripper.writes) == writes


async def test_a_cut_link_ends_a_move_and_comes_back_without_a_write(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    async for _ in hand.statuses():
        if server.gripper.is_moving:
            break
    writes = len(server.gripper.writes)
    transitions = hand.transitions()
    server.cut()
    with pytest.raises(ConnectionLostError):
        await moving
    lost = await anext(transitions)
    back = await anext(transitions)
    assert (lost.target, back.target) == (State.DISCONNECTED, State.RUNNING_IDLE)
    assert back.timestamp - lost.timestamp < 0.2
    assert len(server.gripper.writes) == writes
    assert hand.statistics.reconnects == 1
    assert hand.statistics.foreign_commands == 0


async def test_while_the_link_is_down_nothing_is_known(hand: RobotiqHand, server: SimulatorServer) -> None:
    server.refuse()
    server.cut()
    await hand.wait_for_state(State.DISCONNECTED)
    with pytest.raises(ConnectionLostError):
        hand.command(position=3)
    with pytest.raises(ConnectionLostError):
        await hand.move(3)
    with pytest.raises(ConnectionLostError):
        hand.is_moving  # noqa: B018
    assert hand.status.sequence > 0, "the last status is still there, with its timestamp"
    await server.accept()
    await hand.wait_for_state(State.RUNNING_IDLE)
    await hand.move(30, A)


async def test_a_power_cycle_leaves_the_hand_in_reset_until_it_is_activated(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    async for _ in hand.statuses():
        if server.gripper.is_moving:
            break
    await server.power_cycle(0.5)
    with pytest.raises((ConnectionLostError, NotActivatedError)):
        await moving
    await hand.wait_for_state(State.RESET)
    before = travels(server)
    with pytest.raises(NotActivatedError):
        await hand.move(0)
    assert travels(server) == before
    await hand.recover()
    assert hand.state is State.RUNNING_IDLE


async def test_the_policy_may_activate(server: SimulatorServer) -> None:
    policy = ReconnectPolicy(activate=True)
    async with RobotiqHand(server.address, reconnect=policy) as hand:
        transitions = hand.transitions()
        await server.power_cycle(0.5)
        await hand.wait_for_state(State.DISCONNECTED, State.DO_ACTIVATION)
        await hand.wait_for_state(State.RUNNING_IDLE)
        assert State.RESET not in {(await anext(transitions)).target for _ in range(3)}


async def test_a_hand_that_must_not_reconnect_gives_up(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address, reconnect=False)
    await hand.start()
    statuses = hand.statuses()
    waiting = asyncio.create_task(hand.wait_for_state(State.FAULT))
    await anext(statuses)
    server.cut()

    async def read_on() -> None:
        async for _ in statuses:
            pass

    with pytest.raises(ConnectionLostError):
        await read_on()
    with pytest.raises((ConnectionLostError, NotStartedError)):
        await waiting
    with pytest.raises(ConnectionLostError):
        await hand.move(3)
    with pytest.raises(ConnectionLostError):
        await anext(hand.statuses())
    await hand.stop()
    await hand.start()
    await hand.move(30, A)
    await hand.stop()


# -- 6: cancellation ----------------------------------------------------------------------------------------


@pytest_asyncio.fixture
async def closing(hand: RobotiqHand, server: SimulatorServer) -> AsyncIterator[None]:
    """The gripper is on its way when the test begins."""
    await hand.set_speed(0)
    yield
    assert not server.gripper.is_moving
    assert all(server.gripper.position(axis) < 200 for axis in (A, B, C))


async def until_moving(server: SimulatorServer, hand: RobotiqHand) -> None:
    async for _ in hand.statuses():
        if server.gripper.is_moving:
            return


@pytest.mark.usefixtures("closing")
async def test_a_cancelled_task_stops_its_axes(hand: RobotiqHand, server: SimulatorServer) -> None:
    task = asyncio.create_task(hand.move(255))
    await until_moving(server, hand)
    task.cancel()
    with pytest.raises(asyncio.CancelledError):
        await task
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_asyncio_timeout_stops_the_axes(hand: RobotiqHand) -> None:
    with pytest.raises(TimeoutError):
        async with asyncio.timeout(0.1):
            await hand.move(255)
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_an_anyio_scope_stops_the_axes(hand: RobotiqHand) -> None:
    with anyio.move_on_after(0.1) as scope:
        await hand.move(255)
    assert scope.cancelled_caught
    await settled(hand)


@pytest.mark.usefixtures("closing")
async def test_leaving_through_an_exception_stops_the_fingers(
    server: SimulatorServer, hand: RobotiqHand
) -> None:
    await hand.stop()

    async def fail() -> None:
        async with RobotiqHand(server.address) as other:
            await other.set_position(255)
            raise ZeroDivisionError

    with pytest.raises(ZeroDivisionError):
        await fail()


@pytest.mark.usefixtures("closing")
async def test_leaving_through_a_cancelled_scope_stops_the_fingers(
    server: SimulatorServer, hand: RobotiqHand
) -> None:
    await hand.stop()
    with anyio.CancelScope() as scope:
        async with RobotiqHand(server.address) as other:
            await other.set_position(255)
            scope.cancel()
            await asyncio.sleep(1)
    assert scope.cancelled_caught


async def test_a_cancelled_start_leaves_nothing_running(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start())
    transitions = hand.transitions()
    while (await anext(transitions)).target is not State.WF_ACTIVATION:
        pass
    await until_moving(server, hand)
    starting.cancel()
    with pytest.raises(asyncio.CancelledError):
        await starting
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN


async def test_the_fingers_are_stopped_when_the_loop_is_torn_down(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.set_position(255)
    (poller,) = [task for task in asyncio.all_tasks() if task.get_name() == "robotiq_async poller"]
    poller.cancel()
    await asyncio.wait({poller})
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN


async def test_stop_ends_moves_with_not_started(hand: RobotiqHand) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    await hand.stop()
    with pytest.raises(NotStartedError):
        await moving


async def test_a_cancelled_stop_still_stops(hand: RobotiqHand, server: SimulatorServer) -> None:
    await hand.set_position(255)
    stopping = asyncio.create_task(hand.stop())
    await asyncio.sleep(0)
    stopping.cancel()
    with pytest.raises(asyncio.CancelledError):
        await stopping
    assert hand.state is State.SHUTDOWN
    assert not server.gripper.is_moving


async def test_start_and_stop_from_different_tasks(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    await asyncio.create_task(hand.start(activate=False))
    await asyncio.gather(*(asyncio.create_task(hand.stop()) for _ in range(3)))
    assert hand.state is State.SHUTDOWN


async def test_stop_while_it_starts(server: SimulatorServer) -> None:
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start())
    await asyncio.sleep(0)
    await hand.stop()
    with pytest.raises(NotStartedError):
        await starting


# -- 8: one owner -------------------------------------------------------------------------------------------


async def test_another_client_is_noticed(
    hand: RobotiqHand, server: SimulatorServer, caplog: pytest.LogCaptureFixture
) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await until_moving(server, hand)
    image = Request(activate=True, go=True, axes=(AxisRequest(10, 255, 100),) * 4)
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        server.gripper.write(0, image.registers)
        with pytest.raises(MoveSupersededError):
            await moving
    assert hand.statistics.foreign_commands == 1
    assert "another client" in caplog.text
    await settled(hand)
    assert server.gripper.position(A) == pytest.approx(10, abs=2)


# -- 9: faults ----------------------------------------------------------------------------------------------


async def test_a_fault_ends_a_move_and_nothing_resumes(hand: RobotiqHand, server: SimulatorServer) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await until_moving(server, hand)
    server.gripper.inject_fault(Fault.COMMUNICATION_NOT_READY, 1.0)
    with pytest.raises(GripperFaultError) as caught:
        await moving
    assert caught.value.fault is Fault.COMMUNICATION_NOT_READY
    await hand.wait_for_state(State.RUNNING_IDLE)
    at = server.gripper.position(A)
    await settled(hand)
    assert server.gripper.position(A) == pytest.approx(at, abs=2)


# -- never holds the loop -----------------------------------------------------------------------------------


async def test_the_first_start_imports_nothing(server: SimulatorServer) -> None:
    # An import holds up the loop: anyio's backend, loaded at first use, did so for 20 ms.
    program = f"""
import asyncio, sys
from robotiq_async import RobotiqHand

async def main():
    before = set(sys.modules)
    async with RobotiqHand({server.address!r}) as hand:
        await hand.move(30)
    print(*(set(sys.modules) - before))

asyncio.run(main())
"""
    process = await asyncio.create_subprocess_exec(sys.executable, "-c", program, stdout=PIPE, cwd=ROOT)
    out, _ = await process.communicate()
    assert (process.returncode, out.decode().split()) == (0, [])


async def test_a_held_up_loop_is_noticed_and_survived(
    hand: RobotiqHand, caplog: pytest.LogCaptureFixture
) -> None:
    moving = asyncio.create_task(hand.move(200, A, speed=0))
    await hand.wait_for_state(State.RUNNING_CC)
    overruns = hand.statistics.overruns
    with caplog.at_level(logging.WARNING, logger="robotiq_async"):
        for _ in range(2):
            time.sleep(0.6)  # noqa: ASYNC251  # longer than the response timeout
            await asyncio.sleep(0.02)
    await moving
    statistics = hand.statistics
    assert statistics.reconnects == 0
    assert statistics.overruns - overruns >= 100
    assert statistics.longest_stall > 0.5
    assert len([record for record in caplog.records if "holds up" in record.message]) <= 2


# -- a link that is down: nothing is begun, not even later ----------------------------------------------


async def test_while_the_link_is_down_no_sequence_can_be_asked_for(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.refuse()
    server.cut()
    await hand.wait_for_state(State.DISCONNECTED)
    writes = len(server.gripper.writes)
    for call in (hand.activate, hand.reset, hand.atr, hand.hold, hand.halt, hand.recover):
        with pytest.raises(ConnectionLostError):
            await call()
    assert hand.state is State.DISCONNECTED
    await server.accept()
    await hand.wait_for_state(State.RUNNING_IDLE)
    await settled(hand)
    assert len(server.gripper.writes) == writes


async def test_nothing_can_be_asked_for_while_it_connects(server: SimulatorServer) -> None:
    server.replies.delay(0.1)
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start(activate=False))
    await asyncio.sleep(0)
    for call in (hand.activate, hand.reset, hand.atr, hand.hold, hand.halt):
        with pytest.raises(ConnectionLostError):
            await call()
    await starting
    assert hand.state is State.RESET
    await hand.stop()


async def test_a_gripper_found_in_fault_is_not_taken_for_one_that_others_command(
    server: SimulatorServer,
) -> None:
    server.gripper.inject_fault(Fault.SCISSOR_BLOCKED)
    async with RobotiqHand(server.address) as hand:
        async for status in hand.statuses():
            if status.sequence > 10:
                break
        assert hand.state is State.FAULT
        assert hand.statistics.foreign_commands == 0
