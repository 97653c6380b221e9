"""Hand: what every hand can do. RobotiqHand: the hand that owns the link to its gripper."""

from .base import Hand

__all__ = ["Hand"]
