"""Starts the gripper's node, configured and active: it is connected, and nothing has moved.

    ros2 launch robotiq_async gripper.launch.py address:=tcp://192.168.1.11

Not run yet: no launch_ros was at hand.
"""

from __future__ import annotations

from launch import LaunchDescription
from launch.actions import DeclareLaunchArgument
from launch.substitutions import LaunchConfiguration
from launch_ros.actions import LifecycleNode
from launch_ros.parameter_descriptions import ParameterValue

ARGUMENTS = {
    "address": (
        "sim://",
        "The gripper: tcp://HOST, rtu:///dev/ttyUSB0, zenoh://SITE/HOST/GRIPPER or sim://.",
    ),
    "joint_prefix": ("", "Stands before the name of every joint: left_."),
    "autostart": ("true", "Whether the node configures and activates itself. That moves nothing."),
}


def generate_launch_description() -> LaunchDescription:
    """One node, with the arguments as its parameters."""
    texts = ("address", "joint_prefix")
    parameters = {name: ParameterValue(LaunchConfiguration(name), value_type=str) for name in texts}
    parameters["autostart"] = ParameterValue(LaunchConfiguration("autostart"), value_type=bool)
    namespace = DeclareLaunchArgument("namespace", default_value="", description="Of the node.")
    node = LifecycleNode(
        package="robotiq_async",
        executable="gripper",
        name="gripper",
        namespace=LaunchConfiguration("namespace"),
        parameters=[parameters],
        output="screen",
    )
    declared = [
        DeclareLaunchArgument(name, default_value=default, description=description)
        for name, (default, description) in ARGUMENTS.items()
    ]
    return LaunchDescription([*declared, namespace, node])
