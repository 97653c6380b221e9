"""What a stop ends, what it does not let begin, and what becomes of one that a lost link kept back."""

from __future__ import annotations

import asyncio
import logging
from collections.abc import AsyncIterator

import pytest

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.ros2.gripper.connection import PENDING_S, Connection, RefusedError
from robotiq_async.ros2.gripper.goals import Ending, Outcome
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.ros2.translation.settings import PARAMETERS, check_settings
from robotiq_async.simulator import SimulatedGripper, SimulatorServer
from tests.fleet.lab import lab
from tests.virtual import LATENCY_S

pytestmark = pytest.mark.virtual_time

SETTINGS = check_settings({name: parameter.default for name, parameter in PARAMETERS.items()})
CLOSE = Targets(((240, Finger.ABC),))
POLL_S = 0.02
FAR = 200
"""Fingers that were stopped on their way are not there."""


@pytest.fixture
async def gripper() -> SimulatedGripper:
    """One that takes some three seconds to close."""
    return SimulatedGripper(asyncio.get_running_loop().time, spread=False)


@pytest.fixture
async def connection(server: SimulatorServer) -> AsyncIterator[Connection]:
    """An active node's, at an active gripper."""
    connection = Connection(RobotiqHand(server.address, poll_interval=POLL_S), SETTINGS)
    await connection.open()
    await connection.permit()
    await connection.command("activate")
    yield connection
    await connection.close("the end")


def begin(connection: Connection, targets: Targets = CLOSE, key: bytes = b"1") -> asyncio.Task[Outcome]:
    return asyncio.create_task(
        connection.run_goal(key, targets, SETTINGS, lambda: None, connection.stops), name="goal"
    )


async def until_moving(connection: Connection) -> None:
    async for status in connection.hand.statuses():
        if status.position(Finger.A) > 40:
            return


async def lose_link(connection: Connection, server: SimulatorServer) -> None:
    server.refuse()
    server.cut()
    await connection.hand.wait_for_state(State.DISCONNECTED)


async def settled(gripper: SimulatedGripper) -> int:
    """Where finger A is, after all that was to come has come."""
    await asyncio.sleep(4)
    return gripper.position(Finger.A)


# -- what was asked before -----------------------------------------------------------------------------------


@pytest.mark.parametrize("turns", [1, 2, 3, 4])
async def test_a_goal_that_begins_beside_a_halt_moves_nothing_after_it(
    connection: Connection, gripper: SimulatedGripper, turns: int
) -> None:
    goal = begin(connection)
    for _ in range(turns):
        await asyncio.sleep(0)
    await connection.command("halt")
    assert (await goal).ending is Ending.ABORTED
    assert await settled(gripper) < 20


async def test_a_goal_that_was_accepted_before_a_halt_is_not_begun_after_it(
    connection: Connection, gripper: SimulatedGripper
) -> None:
    accepted_at = connection.stops
    await connection.command("halt")
    writes = len(gripper.writes)
    with pytest.raises(RefusedError, match="a stop took over before it began"):
        await connection.run_goal(b"1", CLOSE, SETTINGS, lambda: None, accepted_at)
    assert len(gripper.writes) == writes


async def test_while_a_halt_is_under_way_nothing_else_is_taken(
    connection: Connection, gripper: SimulatedGripper
) -> None:
    goal = begin(connection)
    await until_moving(connection)
    halting = asyncio.create_task(connection.command("halt"))
    await asyncio.sleep(0)
    with pytest.raises(RefusedError, match="a halt is under way"):
        await begin(connection, key=b"2")
    for name in ("activate", "recover", "reset"):
        with pytest.raises(RefusedError, match="a halt is under way"):
            await connection.command(name)
    await halting
    assert (await goal).reason == "a halt took over"
    assert connection.hand.state is State.RUNNING_IDLE
    assert await settled(gripper) < FAR


@pytest.mark.parametrize("name", ["activate", "recover"])
async def test_a_halt_ends_what_a_service_has_begun(connection: Connection, name: str) -> None:
    await connection.command("reset")
    call = asyncio.create_task(connection.command(name))
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    assert "the gripper is reset" in await connection.command("halt")
    with pytest.raises(RefusedError, match=f"a stop took over: {name} was aborted"):
        await call


@pytest.mark.parametrize("turns", [1, 2])
async def test_an_activation_that_waits_for_its_lease_does_not_begin_after_a_stop(turns: int) -> None:
    async with lab(active=False) as here:
        connection = Connection(here.client(control=None), SETTINGS)
        await connection.open()
        await connection.permit()
        call = asyncio.create_task(connection.command("activate"))
        for _ in range(turns):
            await asyncio.sleep(0)
        await connection.forbid("the node was deactivated")
        with pytest.raises(RefusedError, match="a stop took over"):
            await call
        await asyncio.sleep(1)
        assert connection.hand.state is State.RESET
        await connection.close("the end")


async def test_a_closed_connection_does_not_open_or_take_commands(server: SimulatorServer) -> None:
    connection = Connection(RobotiqHand(server.address), SETTINGS)
    await connection.close("a signal came first")
    for again in (connection.open, connection.permit):
        with pytest.raises(RefusedError, match="the connection has been closed"):
            await again()
    assert not connection.takes_commands


@pytest.mark.parametrize("offset", [0.0, 0.006, 0.012, 0.018])
async def test_a_cancel_is_acknowledged_with_the_next_poll(connection: Connection, offset: float) -> None:
    goal = begin(connection)
    await until_moving(connection)
    await asyncio.sleep(offset)
    asked = asyncio.get_running_loop().time()
    await connection.cancel_goal(b"1")
    assert (await goal).ending is Ending.CANCELED
    assert asyncio.get_running_loop().time() - asked <= POLL_S + 5 * LATENCY_S


# -- what a lost link keeps back -----------------------------------------------------------------------------


async def test_the_fingers_of_a_goal_that_a_lost_link_ended_are_held_when_it_is_back(
    connection: Connection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    goal = begin(connection)
    await until_moving(connection)
    await lose_link(connection, server)
    assert (await goal).ending is Ending.ABORTED
    await asyncio.sleep(0.2)
    assert gripper.is_moving, "nothing can stop them meanwhile"
    await server.accept()
    assert await settled(gripper) < FAR
    outcome = await begin(connection, key=b"2")
    assert outcome.ending is Ending.SUCCEEDED


async def test_until_they_are_held_nothing_else_is_taken(
    connection: Connection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    goal = begin(connection)
    await until_moving(connection)
    await lose_link(connection, server)
    await goal
    with pytest.raises(RefusedError, match="the link to the gripper is down"):
        await begin(connection, key=b"2")
    await server.accept()
    await connection.hand.wait_for_state(State.RUNNING_IDLE)
    with pytest.raises(RefusedError, match="the fingers are not stopped yet"):
        await begin(connection, key=b"2")
    assert await settled(gripper) < FAR


async def test_a_deactivation_without_a_link_halts_when_it_is_back(
    connection: Connection, server: SimulatorServer, caplog: pytest.LogCaptureFixture
) -> None:
    await connection.command("reset")
    call = asyncio.create_task(connection.command("activate"))
    await connection.hand.wait_for_state(State.WF_ACTIVATION)
    await lose_link(connection, server)
    with caplog.at_level(logging.WARNING, "robotiq_async"):
        await connection.forbid("the node was deactivated")
        await asyncio.gather(call, return_exceptions=True)
        await server.accept()
        await connection.hand.wait_for_state(State.RESET, timeout=5)
        await asyncio.sleep(1)
    assert "no halt, the fingers MAY STILL MOVE" in caplog.text
    assert "the link is back, and what still moved has been stopped" in caplog.text


async def test_a_stop_that_would_come_too_late_for_anything_is_not_sent(
    connection: Connection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    await lose_link(connection, server)
    await connection.forbid("the node was deactivated")
    await asyncio.sleep(PENDING_S + 1)
    writes = len(gripper.writes)
    await server.accept()
    await connection.hand.wait_for_state(State.RUNNING_IDLE)
    await settled(gripper)
    assert len(gripper.writes) == writes


async def test_the_end_of_the_node_owes_nothing(
    connection: Connection, gripper: SimulatedGripper, server: SimulatorServer
) -> None:
    goal = begin(connection)
    await until_moving(connection)
    await lose_link(connection, server)
    await goal
    await connection.close("the end")  # no task is left: the fixtures look


@pytest.mark.parametrize("name", ["activate", "reset", "recover", "release"])
async def test_a_connection_that_is_ending_takes_no_command_while_the_rest_ends(
    connection: Connection, gripper: SimulatedGripper, name: str
) -> None:
    """The publishers were stopped first, and commands were taken until that was done."""
    goal = begin(connection)
    await until_moving(connection)
    connection.refuse("the node is shutting down")
    with pytest.raises(RefusedError):
        await connection.command(name)
    with pytest.raises(RefusedError):
        await begin(connection, key=b"2")
    with pytest.raises(RefusedError):
        await connection.permit()
    await connection.close("the node is shutting down")
    assert (await goal).ending is Ending.ABORTED
    assert await settled(gripper) < FAR
