"""Routes of stored messages, series, recordings and the store."""
