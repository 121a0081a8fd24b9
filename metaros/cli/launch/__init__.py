"""`metaros launch`."""
