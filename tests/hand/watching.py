"""What a test waits for, and looks at, at the gripper behind a hand."""

from __future__ import annotations

from robotiq_async import Finger, RobotiqHand, State
from robotiq_async.simulator import SerialSimulatorServer, SimulatorServer
from robotiq_async.values.model import THREE_FINGER
from robotiq_async.values.request import Request


def last_write(server: SimulatorServer) -> Request:
    return Request.from_registers(server.gripper.writes[-1].registers)


def travels(server: SimulatorServer) -> dict[Finger, float]:
    return {axis: server.gripper.travel(axis) for axis in THREE_FINGER.axes}


async def settled(hand: RobotiqHand) -> None:
    """Wait until nothing moves any more."""
    async for _ in hand.statuses():
        if hand.state is State.RUNNING_IDLE and not hand.is_moving:
            return


async def until_moving(server: SimulatorServer | SerialSimulatorServer, hand: RobotiqHand) -> None:
    async for _ in hand.statuses():
        if server.gripper.is_moving:
            return
