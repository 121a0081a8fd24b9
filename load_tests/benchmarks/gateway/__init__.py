"""Benchmarks of the gateway, and of the way from a robot through it to a viewer."""
