"""Stored messages of the fleet, queried by robot, topic and time."""
