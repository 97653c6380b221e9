"""Messages that are encoded here are those of ROS."""

from __future__ import annotations

import math

import pytest
from rclpy.clock import ClockType, ROSClock
from rclpy.serialization import deserialize_message
from rclpy.time import Time
from sensor_msgs.msg import JointState

from robotiq_async.ros2.node.publishing import JointStates, stamp
from robotiq_async.runtime.clock import now
from tests.register_words import status_of


@pytest.mark.parametrize(("prefix", "frame_id"), [("", ""), ("left_", "palm"), ("cell/3.", "a")])
async def test_joint_states(prefix: str, frame_id: str) -> None:
    joints, began = JointStates(ROSClock(), prefix, frame_id), now()
    joints.encoded(status_of(0x31, position=(20, 30, 40, 137), at=began - 0.04))
    status = status_of(0x31, position=(21, 30, 240, 140), at=began)
    read = deserialize_message(joints.encoded(status), JointState)
    made = joints.message(status)
    assert read.header.frame_id == made.header.frame_id == frame_id
    assert read.name == made.name
    assert read.name[0] == f"{prefix}palm_finger_1_joint"
    assert read.position == made.position
    assert read.velocity == made.velocity
    assert any(read.velocity)
    assert len(read.effort) == 11
    assert all(math.isnan(effort) for effort in (*read.effort, *made.effort))
    apart = made.header.stamp.nanosec - read.header.stamp.nanosec
    assert abs(apart) < 50_000_000 or abs(apart) > 950_000_000


async def test_the_stamp_is_the_time_of_ros_when_the_status_was_read() -> None:
    clock = ROSClock()
    assert abs(stamp(clock, now() - 2.0) - (clock.now().nanoseconds - 2_000_000_000)) < 100_000_000
    clock._set_ros_time_is_active(True)
    clock.set_ros_time_override(Time(seconds=50, clock_type=ClockType.ROS_TIME))
    assert abs(stamp(clock, now() - 2.0) - 48_000_000_000) < 100_000_000
