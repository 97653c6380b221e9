"""Publishes joint states, the status and diagnoses while the node is configured.

In the event loop, and the result of a poll in the turn of that poll: waking the executor, or the loop again,
would cost more than the messages do.
"""

from __future__ import annotations

import asyncio
import math
import time
from array import array
from collections.abc import Callable, Sequence
from typing import Final

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ROSClock
from rclpy.node import Node
from rclpy.qos import DurabilityPolicy, QoSProfile
from sensor_msgs.msg import JointState
from std_msgs.msg import String

from ...runtime import now
from ...tools.description.joint_states import JointStateEncoder
from ...values import THREE_FINGER, Model, RobotiqStatus
from ..gripper.connection import GripperConnection
from ..translation.diagnosis import Diagnosis, diagnose, is_connected, status_text
from ..translation.joints import Motion, joint_names, positions
from .timing import Pace, Timer

STATUS_RATE_HZ: Final = 10.0
"""Rate of the status while connected, else the rate below. A change of state is published at once."""
DIAGNOSTICS_RATE_HZ: Final = 1.0
_LATCHED: Final = QoSProfile(depth=1, durability=DurabilityPolicy.TRANSIENT_LOCAL)
"""Late subscribers get the last message."""


class Publishing:
    """The publishers of a node. They exist all the time, but publish only while there is a connection.

    ``failed`` is called, in the loop, if publishing ends with an unexpected error.
    """

    def __init__(self, node: Node, failed: Callable[[BaseException], object]) -> None:
        self._node = node
        self._failed = failed
        self._joint_states = node.create_publisher(JointState, "joint_states", 10)
        self._diagnostics = node.create_publisher(DiagnosticArray, "/diagnostics", 10)
        self._status = node.create_publisher(String, "~/status", _LATCHED)
        self._description = node.create_publisher(String, "robot_description", _LATCHED)
        self._timer: Timer | None = None
        self._readers: list[asyncio.Task[None]] = []

    def describe(self, urdf: str) -> None:
        self._description.publish(String(data=urdf))

    async def start(self, connection: GripperConnection, joint_states: JointStates, rate: float) -> None:
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

    async def _publish_statuses(
        self, connection: GripperConnection, joints: JointStates, rate: float
    ) -> None:
        joint_states, status_pace = Pace(rate), Pace(STATUS_RATE_HZ)
        async for status in connection.hand.statuses():
            if joint_states.takes(status.timestamp):
                self._joint_states.publish(joints.encoded(status))
            if status_pace.takes(status.timestamp):
                self.publish_status(connection)

    async def _publish_transitions(self, connection: GripperConnection, joints: JointStates) -> None:
        async for _ in connection.hand.transitions():
            self.publish_status(connection)
            if not is_connected(connection.hand):
                joints.forget()

    def publish_status(self, connection: GripperConnection) -> None:
        text = status_text(connection.hand, takes_commands=connection.takes_commands)
        self._status.publish(String(data=text))

    def _publish_rarely(self, connection: GripperConnection) -> None:
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


class JointStates:
    """Joint states of one hand. Belongs to the event loop."""

    def __init__(self, clock: ROSClock, prefix: str, frame_id: str) -> None:
        self._clock = clock
        self._prefix = prefix
        self._frame_id = frame_id
        self._begin(THREE_FINGER)

    def _begin(self, model: Model) -> None:
        self._model = model
        self._names = joint_names(self._prefix, model)
        self._encoder = JointStateEncoder(self._frame_id, self._names)
        self._motion = Motion()
        self._velocities: Sequence[float] = (0.0,) * len(self._names)
        self._unknown = (math.nan,) * len(self._names)
        """Efforts are NaN: the gripper reports currents, and no torque is known for them."""

    def encoded(self, status: RobotiqStatus) -> bytes:
        """A serialized message for publishing: building one as an object takes four times as long."""
        if status.model is not self._model:  # a remote hand learns it when it connects
            self._begin(status.model)
        positions, self._velocities = self._motion.of(status)
        nanoseconds = stamp(self._clock, status.timestamp)
        return self._encoder.encode(nanoseconds, positions, self._velocities, self._unknown)

    def message(self, status: RobotiqStatus) -> JointState:
        """A message for feedback and results, with the velocities that were published last."""
        if status.model is not self._model:
            self._begin(status.model)
        message = JointState()
        seconds, nanoseconds = divmod(stamp(self._clock, status.timestamp), 1_000_000_000)
        message.header.stamp = Time(sec=seconds, nanosec=nanoseconds)
        message.header.frame_id = self._frame_id
        message.name = self._names
        message.position = array("d", positions(status))
        message.velocity = array("d", self._velocities)
        message.effort = array("d", self._unknown)
        return message

    def forget(self) -> None:
        # After a lost link the next position is not a motion since the last one.
        self._motion.forget()


def stamp(clock: ROSClock, timestamp: float) -> int:
    """The ROS time, in nanoseconds, of a timestamp in monotonic seconds: the present time less its age."""
    # Without simulated time it is the system time; reading it through ROS costs as much as the message.
    ros = int(clock.now().nanoseconds) if clock.ros_time_is_active else time.time_ns()
    return max(0, ros - round((now() - timestamp) * 1e9))


def diagnostic_array(
    clock: Clock, node_name: str, hardware_id: str, diagnoses: tuple[Diagnosis, ...]
) -> DiagnosticArray:
    message = DiagnosticArray()
    message.header.stamp = clock.now().to_msg()
    message.status = [
        DiagnosticStatus(
            level=bytes([each.level]),  # ROS wants a byte, not an int
            name=f"{node_name}: {each.what}",
            message=each.message,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in each.values.items()],
        )
        for each in diagnoses
    ]
    return message
