"""Relays frames, graphs, goals and leases of robots that are linked to another gateway."""
