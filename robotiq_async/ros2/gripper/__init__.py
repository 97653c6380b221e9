"""What a configured node has: one gripper, its goals and its commands. In the event loop; knows no ROS."""
