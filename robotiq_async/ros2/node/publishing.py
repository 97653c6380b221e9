"""What the node publishes while it is configured: joint states, its status, diagnoses.

Published from the event loop: waking ROS's executor for it would cost more than the messages do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from contextlib import suppress
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ...errors import NotStartedError
from ...session.clock import now
from ..gripper.connection import Connection
from ..translation.diagnosis import diagnose, status_text
from ..translation.readiness import is_connected
from .messages import JointStates, diagnostic_array

STATUS_RATE_HZ: Final = 10.0
"""Of the status; a change of state is published at once."""
DIAGNOSTICS_RATE_HZ: Final = 1.0
_LATEST: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Whoever comes later gets the newest one."""


class Publishing:
    """The publishers of a node. They stay; what they publish begins and ends with a connection."""

    def __init__(self, node: Node, failed: Callable[[BaseException], object]) -> None:
        """Advertise the topics.

        Args:
            node: of which.
            failed: is called, in the loop, if publishing ends for a reason that nobody has thought of.
        """
        self._node = node
        self._failed = failed
        self._joint_states = node.create_publisher(JointState, "joint_states", 10)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._status = node.create_publisher(String, "~/status", _LATEST)
        self._description = node.create_publisher(String, "robot_description", _LATEST)
        self._tasks: list[asyncio.Task[None]] = []

    def describe(self, urdf: str) -> None:
        """Publish the robot description."""
        self._description.publish(String(data=urdf))

    async def start(self, connection: Connection, joint_states: JointStates, rate: float) -> None:
        """Publish what the hand of a connection shows."""
        works = (
            self._publish_joints(connection, joint_states, 1 / rate),
            _every(1 / STATUS_RATE_HZ, lambda: self._publish_status(connection)),
            self._publish_transitions(connection),
            _every(1 / DIAGNOSTICS_RATE_HZ, lambda: self._publish_diagnoses(connection)),
        )
        self._tasks = [asyncio.ensure_future(work) for work in works]
        for task in self._tasks:
            task.add_done_callback(self._look)

    async def stop(self) -> None:
        """Publish nothing more. Idempotent."""
        tasks, self._tasks = self._tasks, []
        for task in tasks:
            task.cancel()
        await asyncio.gather(*tasks, return_exceptions=True)

    def _look(self, task: asyncio.Task[None]) -> None:
        if not task.cancelled() and (error := task.exception()) is not None:
            self._failed(error)

    async def _publish_joints(self, connection: Connection, joints: JointStates, period: float) -> None:
        hand, last = connection.hand, -1.0

        def publish() -> None:
            nonlocal last
            if not is_connected(hand):
                joints.forget()
                return
            status = hand.status
            if status.timestamp > last:  # of a hand on another host there may be no news yet
                last = status.timestamp
                self._joint_states.publish(joints.shared(status))

        await _every(period, publish)

    async def _publish_transitions(self, connection: Connection) -> None:
        async for _ in connection.hand.transitions():
            self._publish_status(connection)

    def _publish_status(self, connection: Connection) -> None:
        text = status_text(connection.hand, takes_commands=connection.takes_commands)
        self._status.publish(String(data=text))

    def _publish_diagnoses(self, connection: Connection) -> None:
        hand = connection.hand
        self._diagnostics.publish(
            diagnostic_array(
                self._node.get_clock(),
                self._node.get_fully_qualified_name(),
                hand.address,
                diagnose(hand, now()),
            )
        )


async def _every(period: float, work: Callable[[], object]) -> None:
    """Do something at a rate; what is missed is missed."""
    due = now()
    while True:
        with suppress(NotStartedError):  # the hand was stopped in this moment, and so will this be
            work()
        due = max(due + period, now())
        await asyncio.sleep(due - now())
