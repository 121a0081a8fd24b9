"""Nodes with a lifecycle."""
