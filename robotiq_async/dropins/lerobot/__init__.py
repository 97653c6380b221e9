"""LeRobot: the part that an arm's robot class embeds, and the robot around it.

================  =================================================================================
module            contents
================  =================================================================================
``gripper_part``  the part: connect, observe, act, disconnect; imports nothing of LeRobot
``robot``         the robot, which the distribution ``lerobot_robot_robotiq`` lets LeRobot find
================  =================================================================================
"""

from __future__ import annotations

from .gripper_part import GripperPart

__all__ = ["GripperPart"]


def __getattr__(name: str) -> object:
    """The robot, for which LeRobot looks here: it comes late, because the part works without LeRobot."""
    if name not in ("RobotiqGripper", "RobotiqGripperConfig"):
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    from . import robot  # noqa: PLC0415  # needs LeRobot

    return getattr(robot, name)
