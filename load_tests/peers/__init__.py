"""What the benchmark `peers` measures: one small module a peer, and what runs and reads them."""
