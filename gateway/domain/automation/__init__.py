"""Events, rules and calls of functions, as data."""
