"""The module that LeRobot imports to find ``--robot.type=robotiq_gripper``."""

from robotiq_async.dropins.lerobot.robot import RobotiqGripper, RobotiqGripperConfig

__all__ = ["RobotiqGripper", "RobotiqGripperConfig"]
