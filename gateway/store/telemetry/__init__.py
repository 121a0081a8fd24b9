"""Messages and numeric series: how they are kept, compacted, found and read."""
