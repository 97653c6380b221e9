"""The gripper of a configured node, its goals and commands. In the event loop; does not import ROS."""
