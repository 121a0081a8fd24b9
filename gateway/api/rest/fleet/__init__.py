"""Routes of robots, commands, twins, nodes, rollouts."""
