"""The black box: the last minutes of everything at full rate on the robot's own disk, and the clips cut from it."""
