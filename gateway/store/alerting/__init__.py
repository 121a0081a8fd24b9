"""Tables of alerts and of what watches the robots."""
