"""`metaros top`."""
