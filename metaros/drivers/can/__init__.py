"""A CAN bus: its frames as they are, and the signals that a DBC file names."""
