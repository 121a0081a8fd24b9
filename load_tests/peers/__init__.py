"""The peers that `load_tests.bench_peers` measures: one small module a peer, and what runs and reads them."""
