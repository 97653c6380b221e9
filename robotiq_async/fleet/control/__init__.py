"""Who commands a gripper, and which requests are let in. Pure."""
