"""Event source mappings: topics of robots read in batches for a function."""
