"""What the node publishes while it is configured: joint states, its status, diagnoses.

Published from the event loop, and what a poll has shown in the turn of that poll: to wake the executor
or the loop for it would cost more than the messages do.
"""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from typing import Final

from diagnostic_msgs.msg import DiagnosticArray
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ...runtime.clock import now
from ..gripper.connection import Connection
from ..translation.diagnosis import diagnose, status_text
from ..translation.pace import Pace
from ..translation.readiness import is_connected
from .messages import JointStates, diagnostic_array
from .timer import Timer

STATUS_RATE_HZ: Final = 10.0
"""Of the status while the gripper is heard, else the rate below; a change of state is published at once."""
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
        self._timer: Timer | None = None
        self._readers: list[asyncio.Task[None]] = []

    def describe(self, urdf: str) -> None:
        """Publish the robot description."""
        self._description.publish(String(data=urdf))

    async def start(self, connection: Connection, joint_states: JointStates, rate: float) -> None:
        """Publish what the hand of a connection shows."""
        self._timer = Timer(1 / DIAGNOSTICS_RATE_HZ, lambda: self._publish_rarely(connection), self._failed)
        readers = (
            self._publish_statuses(connection, joint_states, rate),
            self._publish_transitions(connection, joint_states),
        )
        self._readers = [asyncio.ensure_future(reader) for reader in readers]
        for reader in self._readers:
            reader.add_done_callback(self._look)

    async def stop(self) -> None:
        """Publish nothing more. Idempotent."""
        if self._timer is not None:
            self._timer.cancel()
        readers, self._readers = self._readers, []
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)

    def _look(self, reader: asyncio.Task[None]) -> None:
        if not reader.cancelled() and (error := reader.exception()) is not None:
            self._failed(error)

    async def _publish_statuses(self, connection: Connection, joints: JointStates, rate: float) -> None:
        joint_states, told = Pace(rate), Pace(STATUS_RATE_HZ)
        async for status in connection.hand.statuses():
            if joint_states.takes(status.timestamp):
                self._joint_states.publish(joints.encoded(status))
            if told.takes(status.timestamp):
                self.tell_status(connection)

    async def _publish_transitions(self, connection: Connection, joints: JointStates) -> None:
        async for _ in connection.hand.transitions():
            self.tell_status(connection)
            if not is_connected(connection.hand):
                joints.forget()

    def tell_status(self, connection: Connection) -> None:
        """Publish the status as it is now."""
        text = status_text(connection.hand, takes_commands=connection.takes_commands)
        self._status.publish(String(data=text))

    def _publish_rarely(self, connection: Connection) -> None:
        """What comes also while nothing is heard of the gripper."""
        self.tell_status(connection)
        hand = connection.hand
        self._diagnostics.publish(
            diagnostic_array(
                self._node.get_clock(),
                self._node.get_fully_qualified_name(),
                hand.address,
                diagnose(hand, now()),
            )
        )
