"""Commands, twins, nodes and leases, as data."""
