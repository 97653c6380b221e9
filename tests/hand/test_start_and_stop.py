"""From start() to stop(): what is activated, what is written, and who is told that it cannot be."""

from __future__ import annotations

import pytest

from robotiq_async import (
    ActivationTimeoutError,
    ConnectFailedError,
    InvalidStateError,
    NotActivatedError,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from tests.hand.watching import last_write, travels

pytestmark = pytest.mark.virtual_time

A, B, C, S = THREE_FINGER.axes


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


async def test_an_activation_that_takes_too_long_fails_the_start_and_is_taken_back() -> None:
    async with SimulatorServer() as server:
        hand = RobotiqHand(server.address, activation_timeout=0.2)
        with pytest.raises(ActivationTimeoutError):
            await hand.start()
        assert not server.gripper.is_moving
        assert not last_write(server).activate


async def test_a_start_that_finds_nobody_names_the_address() -> None:
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
