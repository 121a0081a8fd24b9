"""Routes of rules, functions, hooks and the queue."""
