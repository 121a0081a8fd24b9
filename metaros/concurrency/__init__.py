"""Waiting, signals and locks between threads and processes, without losing a Ctrl-C."""
