"""Who the robot is: its key, its certificate, how it came by them and how it keeps them."""
