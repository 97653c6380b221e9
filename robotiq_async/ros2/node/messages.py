"""Messages of ROS from what a hand shows."""

from __future__ import annotations

import math
from array import array

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock
from sensor_msgs.msg import JointState

from ...session.clock import now
from ...wire.status import RobotiqStatus
from ..translation.diagnosis import Diagnosis
from ..translation.joints import Velocities, joint_names, positions


class JointStates:
    """Joint states of one hand. Belongs to the event loop."""

    def __init__(self, clock: Clock, prefix: str, frame_id: str) -> None:
        """Keep what is the same in every message."""
        self._clock = clock
        self._names = joint_names(prefix)
        self._frame_id = frame_id
        self._velocities = Velocities()
        self._message = self._new()

    def shared(self, status: RobotiqStatus) -> JointState:
        """A message to be published at once: the next call changes it. That halves what it costs."""
        return self._filled(self._message, status, self._velocities.of(status))

    def fresh(self, status: RobotiqStatus) -> JointState:
        """A message to keep: for feedback and results. Its velocities are those last published."""
        return self._filled(self._new(), status, self._message.velocity)

    def forget(self) -> None:
        """The link was down: what comes next is no motion since."""
        self._velocities.forget()

    def _new(self) -> JointState:
        message = JointState()
        message.header.frame_id = self._frame_id
        message.name = self._names
        message.velocity = array("d", [0.0] * len(self._names))
        # Currents are known, torques are not: no number is better than a wrong one.
        message.effort = array("d", [math.nan] * len(self._names))
        return message

    def _filled(self, message: JointState, status: RobotiqStatus, velocities: list[float]) -> JointState:
        message.header.stamp = stamp(self._clock, status.timestamp)
        message.position = array("d", positions(status))
        message.velocity = array("d", velocities)
        return message


def stamp(clock: Clock, timestamp: float) -> Time:
    """The time of ROS for a timestamp in monotonic seconds: now, less its age."""
    nanoseconds = max(0, clock.now().nanoseconds - round((now() - timestamp) * 1e9))
    seconds, rest = divmod(nanoseconds, 1_000_000_000)
    return Time(sec=seconds, nanosec=rest)


def diagnostic_array(
    clock: Clock, node_name: str, hardware_id: str, diagnoses: tuple[Diagnosis, ...]
) -> DiagnosticArray:
    """Diagnoses for ``/diagnostics``."""
    message = DiagnosticArray()
    message.header.stamp = clock.now().to_msg()
    message.status = [
        DiagnosticStatus(
            level=bytes([each.level]),  # a byte, and no int
            name=f"{node_name}: {each.what}",
            message=each.message,
            hardware_id=hardware_id,
            values=[KeyValue(key=key, value=value) for key, value in each.values.items()],
        )
        for each in diagnoses
    ]
    return message
