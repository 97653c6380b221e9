"""What can go wrong between a client and a gripper, as data."""
