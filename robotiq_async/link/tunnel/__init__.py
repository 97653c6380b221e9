"""Tunnels: gripper and hand on two sides of a protocol that an application knows."""
