"""What a fleet sent, asked for by robot, topic and time."""
