"""Settings of the agent: command line, environment and agent.toml, checked before anything starts."""
