"""The interfaces of can_msgs."""
