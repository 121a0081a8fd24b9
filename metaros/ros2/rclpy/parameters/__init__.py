"""Parameters of nodes: declared and set here, or on another node; and what happens to them."""
