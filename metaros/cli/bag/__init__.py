"""`metaros bag`."""
