"""Migration 9: twins and templates."""

from __future__ import annotations

__all__ = ["TWINS"]

TWINS = "SELECT 1;"
