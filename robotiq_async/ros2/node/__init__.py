"""The lifecycle node: all that imports rclpy. The hand is reached across the bridge."""
