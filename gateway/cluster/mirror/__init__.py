"""Replicates the state of every gateway's robots into the registries of all others."""
