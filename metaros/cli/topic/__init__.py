"""`metaros topic`."""
