"""The interfaces of statistics_msgs."""
