"""Detectors: each learns what is usual of many series, and scores what comes."""
