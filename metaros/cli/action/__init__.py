"""`metaros action`."""
