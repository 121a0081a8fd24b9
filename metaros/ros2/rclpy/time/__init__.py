"""Times, clocks, timers and rates."""
