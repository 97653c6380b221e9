"""What was asked of the gripper, what was written for it, and what of that shows."""
