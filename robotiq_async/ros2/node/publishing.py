"""Publishes joint states, the status and diagnoses while the node is configured.

In the event loop, and the result of a poll in the turn of that poll: waking the executor, or the loop again,
would cost more than the messages do.
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
"""Rate of the status while connected, else the rate below. A change of state is published at once."""
DIAGNOSTICS_RATE_HZ: Final = 1.0
_LATEST: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late subscribers get the last message."""


class Publishing:
    """The publishers of a node. They exist all the time, but publish only while there is a connection.

    Args:
        node: the node of the topics.
        failed: called, in the loop, if publishing ends with an unexpected error.
    """

    def __init__(self, node: Node, failed: Callable[[BaseException], object]) -> None:
        self._node = node
        self._failed = failed
        self._joint_states = node.create_publisher(JointState, "joint_states", 10)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._status = node.create_publisher(String, "~/status", _LATEST)
        self._description = node.create_publisher(String, "robot_description", _LATEST)
        self._timer: Timer | None = None
        self._readers: list[asyncio.Task[None]] = []

    def describe(self, urdf: str) -> None:
        self._description.publish(String(data=urdf))

    async def start(self, connection: Connection, joint_states: JointStates, rate: float) -> None:
        """Publish the hand of a connection; ``rate`` is in joint states a second."""
        self._timer = Timer(1 / DIAGNOSTICS_RATE_HZ, lambda: self._publish_rarely(connection), self._failed)
        readers = (
            self._publish_statuses(connection, joint_states, rate),
            self._publish_transitions(connection, joint_states),
        )
        self._readers = [asyncio.ensure_future(reader) for reader in readers]
        for reader in self._readers:
            reader.add_done_callback(self._check_reader)

    async def stop(self) -> None:
        """Publish nothing more. Idempotent."""
        if self._timer is not None:
            self._timer.cancel()
        readers, self._readers = self._readers, []
        for reader in readers:
            reader.cancel()
        await asyncio.gather(*readers, return_exceptions=True)

    def _check_reader(self, reader: asyncio.Task[None]) -> None:
        if not reader.cancelled() and (error := reader.exception()) is not None:
            self._failed(error)

    async def _publish_statuses(self, connection: Connection, joints: JointStates, rate: float) -> None:
        joint_states, status_pace = Pace(rate), Pace(STATUS_RATE_HZ)
        async for status in connection.hand.statuses():
            if joint_states.takes(status.timestamp):
                self._joint_states.publish(joints.encoded(status))
            if status_pace.takes(status.timestamp):
                self.publish_status(connection)

    async def _publish_transitions(self, connection: Connection, joints: JointStates) -> None:
        async for _ in connection.hand.transitions():
            self.publish_status(connection)
            if not is_connected(connection.hand):
                joints.forget()

    def publish_status(self, connection: Connection) -> None:
        text = status_text(connection.hand, takes_commands=connection.takes_commands)
        self._status.publish(String(data=text))

    def _publish_rarely(self, connection: Connection) -> None:
        # Also while the link is down: readers must learn of that.
        self.publish_status(connection)
        hand = connection.hand
        self._diagnostics.publish(
            diagnostic_array(
                self._node.get_clock(),
                self._node.get_fully_qualified_name(),
                hand.address,
                diagnose(hand, now()),
            )
        )
