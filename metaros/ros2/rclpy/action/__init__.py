"""Action clients and servers."""
