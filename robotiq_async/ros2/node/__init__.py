"""The lifecycle node: everything that touches rclpy. The hand is asked across the bridge."""
