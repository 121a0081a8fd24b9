"""The interfaces of test_msgs."""
