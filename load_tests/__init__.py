"""Benchmarks, campaigns and the fleet simulator: the proof."""
