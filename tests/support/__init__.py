"""Shared test support: data sets, ports, waiting."""
