"""Migration 4: metric chunks with small columns and summaries."""

from __future__ import annotations

__all__ = ["SERIES"]

SERIES = "SELECT 1;"
