"""Between the words of ROS and those of the hand. Pure: knows no ROS and no event loop."""
