"""Parameters of nodes, and clients of them."""
