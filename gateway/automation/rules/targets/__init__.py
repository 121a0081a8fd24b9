"""What rules do: a handler of the queue for each kind of target."""
