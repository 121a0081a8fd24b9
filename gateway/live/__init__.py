"""Live fan-out: viewers' subscriptions, the queue of each, and the demand that is sent to robots."""
