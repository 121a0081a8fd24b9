"""The black box: the last minutes of every topic at full rate on the robot's own disk, and clips of it."""
