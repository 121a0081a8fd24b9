"""`metaros driver`."""
