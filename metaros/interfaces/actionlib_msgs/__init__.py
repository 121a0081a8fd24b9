"""The interfaces of actionlib_msgs."""
