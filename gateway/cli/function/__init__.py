"""`metaros function`."""
