"""Tables of commands, twins, rollouts, updates and recordings."""
