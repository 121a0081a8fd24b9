"""ROS 2 programs on this library: rclpy's shape, message modules, and what else such programs import."""
