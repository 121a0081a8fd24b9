"""Inertial measurement units on a serial line."""
