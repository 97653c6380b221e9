"""Converts between ROS and the hand. Pure: imports neither ROS nor the event loop."""
