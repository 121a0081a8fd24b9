"""The interfaces of metaros_msgs."""
