"""The agent's half of the link: a pure session and the thin shells that carry its frames."""
