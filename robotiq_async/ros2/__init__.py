"""A ROS 2 lifecycle node around a hand; rclpy comes from the user's ROS."""
