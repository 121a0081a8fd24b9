"""What the agent keeps in its directory."""
