"""RobotiqHand, the hand that owns the link to its gripper, and its run from start() to stop()."""
