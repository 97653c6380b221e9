"""What the gripper does: axes, contacts, faults, and the words it reports. No I/O; its clock is injected."""
