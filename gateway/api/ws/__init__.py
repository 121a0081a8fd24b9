"""WebSockets under /api/v1."""
