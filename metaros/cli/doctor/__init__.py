"""`metaros doctor`."""
