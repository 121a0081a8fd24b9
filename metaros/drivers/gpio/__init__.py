"""Pins of single-board computers: switches that are read, lamps and relays that are set."""
