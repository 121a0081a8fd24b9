"""From the ROS graph to what leaves the robot: the tap, channels, filters, and the queues before the uplink."""
