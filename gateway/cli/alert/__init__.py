"""`metaros alert`."""
