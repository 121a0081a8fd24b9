"""`metaros graph`."""
