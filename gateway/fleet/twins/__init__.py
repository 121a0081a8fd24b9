"""Twins: what robots are to be, what they say they are, and templates for many."""
