"""Benchmarks of `metaros`: transport, codec, executors, drivers, recorder, and how long programs take to start."""
