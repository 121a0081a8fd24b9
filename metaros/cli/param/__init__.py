"""`metaros param`."""
