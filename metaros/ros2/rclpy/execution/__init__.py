"""Executors and what they run."""
