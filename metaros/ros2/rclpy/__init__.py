"""`rclpy`, in the shape that programs for ROS 2 Jazzy know, on this library's nodes."""
