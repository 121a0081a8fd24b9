"""A node's time: simulated time, and rates to sleep by."""
