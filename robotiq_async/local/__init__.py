"""RobotiqHand, the hand that owns the link to its gripper, and its run from start() to stop()."""

from .robotiq_hand import RobotiqHand

__all__ = ["RobotiqHand"]
