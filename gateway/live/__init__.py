"""Live fan-out: what viewers subscribe to, what waits for each of them, and what robots are asked to send for it."""
