"""`metaros ros2`: programs written for ROS 2."""
