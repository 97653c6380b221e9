"""A link that is lost: nothing is sent again, nothing is begun, and nothing is activated unasked."""

from __future__ import annotations

import asyncio

import pytest

from robotiq_async import (
    ConnectionLostError,
    Finger,
    NotStartedError,
    RobotiqHand,
    State,
)
from robotiq_async.simulator import SimulatorServer
from robotiq_async.simulator.troubles.corruption import unchanged
from robotiq_async.values.request import Request
from tests.contract.bench import at_rest
from tests.grippers import until_moving

A = Finger.A


async def test_a_command_that_was_not_acknowledged_is_never_sent_again(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    server.policy = lambda _: []
    with pytest.raises(ConnectionLostError):
        await hand.set_position(200, A)
    sent = [
        write for write in server.gripper.writes if Request.from_registers(write.registers).position(A) == 200
    ]
    assert len(sent) <= 1
    server.policy = unchanged
    await hand.wait_for_state(State.RUNNING_IDLE)
    writes = len(server.gripper.writes)
    await at_rest(hand)
    assert len(server.gripper.writes) == writes


async def test_a_cut_link_ends_a_move_and_comes_back_without_a_write(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    moving = asyncio.create_task(hand.move(255, speed=0))
    await until_moving(server, hand)
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


async def test_nothing_can_be_asked_for_while_it_connects(server: SimulatorServer) -> None:
    server.policy = lambda frame: [(0.1, frame)]
    hand = RobotiqHand(server.address)
    starting = asyncio.create_task(hand.start(activate=False))
    await asyncio.sleep(0)
    for call in (hand.activate, hand.reset, hand.atr, hand.hold, hand.halt):
        with pytest.raises(ConnectionLostError):
            await call()
    await starting
    assert hand.state is State.RESET
    await hand.stop()


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
