"""Hand: the calls of every hand. RobotiqHand: the hand that owns the link to its gripper."""

from .base import Hand

__all__ = ["Hand"]
