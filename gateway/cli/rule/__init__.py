"""`metaros rule`."""
