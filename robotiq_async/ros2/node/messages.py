"""Messages of ROS from the statuses of a hand."""

from __future__ import annotations

import math
import time
from array import array
from collections.abc import Sequence

from builtin_interfaces.msg import Time
from diagnostic_msgs.msg import DiagnosticArray, DiagnosticStatus, KeyValue
from rclpy.clock import Clock, ROSClock
from sensor_msgs.msg import JointState

from ...runtime.clock import now
from ...tools.description.joint_states import JointStateEncoder
from ...values.model import THREE_FINGER, Model
from ...values.status import RobotiqStatus
from ..translation.diagnosis import Diagnosis
from ..translation.joints import Motion, joint_names, positions


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
