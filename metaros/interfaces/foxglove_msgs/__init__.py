"""The interfaces of foxglove_msgs."""
