"""`metaros gateway store`."""
