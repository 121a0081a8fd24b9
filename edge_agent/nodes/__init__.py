"""The robot's nodes as the agent sees them: what is wanted, the supervisor that runs them, and how they do."""
