"""What the gateway sends into the world of its own accord: to whom it may, and signed."""
