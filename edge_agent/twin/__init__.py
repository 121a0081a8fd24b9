"""What the robot is to be, as its gateway says: kept, applied, confirmed or taken back, and reported."""
