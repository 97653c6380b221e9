"""Failures between a client and a gripper, as data."""
