"""Which events matter, and when: event patterns, conditions with a memory, schedules. Pure; time is an argument."""
