"""`metaros dds`."""
