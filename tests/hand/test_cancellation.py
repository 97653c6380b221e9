"""What ends a hand halfway, below its calls: a scope of anyio's, and a loop that is torn down."""

from __future__ import annotations

import asyncio

import anyio

from robotiq_async import RobotiqHand, State
from robotiq_async.simulator import SimulatorServer


async def test_leaving_through_a_cancelled_scope_stops_the_fingers(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    """Each await inside such a scope is cancelled, those of stop() too."""
    await hand.stop()
    with anyio.CancelScope() as scope:
        async with RobotiqHand(server.address, speed=0) as other:
            await other.set_position(255)
            scope.cancel()
            await asyncio.sleep(1)
    assert scope.cancelled_caught
    assert not server.gripper.is_moving
    assert all(server.gripper.position(axis) < 200 for axis in (1, 2, 4))


async def test_the_fingers_are_stopped_when_the_loop_is_torn_down(
    hand: RobotiqHand, server: SimulatorServer
) -> None:
    await hand.set_position(255)
    (poller,) = [task for task in asyncio.all_tasks() if task.get_name() == "robotiq_async poller"]
    poller.cancel()
    await asyncio.wait({poller})
    assert not server.gripper.is_moving
    assert hand.state is State.SHUTDOWN
