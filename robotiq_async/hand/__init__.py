"""RobotiqHand: one gripper, for the program that moves it.

What it shows, how it recovers, what it is told and how it lives are a file each, in this order.
"""

from .robotiq_hand import RobotiqHand

__all__ = ["RobotiqHand"]
