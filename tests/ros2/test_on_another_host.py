"""The node's side of a hand that an agent on another host serves: what is done with a hand is the same."""

from __future__ import annotations

import asyncio
from collections.abc import AsyncIterator
from dataclasses import replace

import pytest

from robotiq_async import Finger, State
from robotiq_async.ros2.gripper.connection import GripperConnection
from robotiq_async.ros2.gripper.goals import GoalEnding, GoalOutcome
from robotiq_async.ros2.translation.diagnosis import DiagnosticLevel, diagnose
from robotiq_async.ros2.translation.joints import Targets
from robotiq_async.runtime.clock import now
from tests.fleet.lab import Lab, lab
from tests.grippers import shows
from tests.ros2.test_connection import CLOSE, SETTINGS, moving

pytestmark = pytest.mark.virtual_time


@pytest.fixture
async def here() -> AsyncIterator[Lab]:
    async with lab() as here:
        yield here


@pytest.fixture
async def connection(here: Lab) -> AsyncIterator[GripperConnection]:
    """The connection of an active node."""
    connection = GripperConnection(here.client(control=None), SETTINGS)
    await connection.open()
    assert not connection.hand.is_in_control, "connecting only reads"  # type: ignore[attr-defined]
    await connection.permit()
    yield connection
    await connection.close("the end")


def run(connection: GripperConnection, key: bytes, targets: Targets = CLOSE) -> asyncio.Task[GoalOutcome]:
    return asyncio.create_task(connection.run_goal(key, targets, SETTINGS, lambda: None, 0))


async def test_a_goal_and_its_cancellation(here: Lab, connection: GripperConnection) -> None:
    assert [each.level for each in diagnose(connection.hand, now())] == [
        DiagnosticLevel.OK,
        DiagnosticLevel.OK,
    ]
    outcome = await run(connection, b"2", Targets(((30, Finger.A), (35, Finger.B))))
    assert outcome.ending is GoalEnding.SUCCEEDED
    reached = [here.gripper.position(axis) for axis in (Finger.A, Finger.B)]
    assert reached == pytest.approx([30, 35], abs=2)
    goal = await moving(connection)
    await connection.cancel_goal(b"1")
    assert (await goal).ending is GoalEnding.CANCELED
    there = here.gripper.position(Finger.A)
    assert there < 200
    await asyncio.sleep(0.5)
    assert abs(here.gripper.position(Finger.A) - there) <= 3
    await connection.close("the end")
    assert not connection.hand.is_in_control  # type: ignore[attr-defined]


async def test_axes_moved_by_a_goal_are_held_when_the_agent_has_its_gripper_back(
    here: Lab, connection: GripperConnection
) -> None:
    slow = replace(SETTINGS, speed=0)
    goal = asyncio.create_task(connection.run_goal(b"1", CLOSE, slow, lambda: None, 0))
    await shows(connection.hand, lambda status: status.position(Finger.A) > 40)
    here.server.refuse()
    here.server.cut()
    assert (await goal).ending is GoalEnding.ABORTED
    assert here.gripper.is_moving
    await here.server.accept()
    await connection.hand.wait_for_state(State.RUNNING_IDLE)
    await asyncio.sleep(0.3)
    assert not here.gripper.is_moving
    assert here.gripper.position(Finger.A) < 200


async def test_after_a_halt_from_elsewhere_the_node_has_to_be_configured_anew(
    here: Lab, connection: GripperConnection
) -> None:
    goal = await moving(connection)
    other = here.client("other", control=False)
    await other.start(activate=False)
    await other.halt()
    assert (await goal).ending is GoalEnding.ABORTED
    again = await run(connection, b"2")
    assert again.ending is GoalEnding.ABORTED
    assert "lost control of" in again.reason
    assert not here.gripper.is_moving
    await connection.close("the node was cleaned up")
    anew = GripperConnection(here.client("anew", control=None), SETTINGS)
    await anew.open()
    await anew.permit()
    assert (await run(anew, b"3")).ending is GoalEnding.SUCCEEDED
    await anew.close("the end")
    await other.stop()
