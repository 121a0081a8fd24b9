"""`metaros broker`."""
