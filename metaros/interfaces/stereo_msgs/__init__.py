"""The interfaces of stereo_msgs."""
