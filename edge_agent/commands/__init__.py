"""What the gateway asks of a robot: commands, each executed once, and teleop behind its watchdogs."""
