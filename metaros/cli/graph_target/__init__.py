"""The ROS graph that a command reads: this machine's, or with `--robot ID` that of a remote robot."""
