"""Contexts, nodes and their endpoints."""
