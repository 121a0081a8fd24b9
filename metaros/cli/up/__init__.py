"""`metaros up`."""
