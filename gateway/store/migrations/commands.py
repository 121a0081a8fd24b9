"""Migration 11: durable commands."""

from __future__ import annotations

__all__ = ["COMMANDS"]

COMMANDS = "SELECT 1;"
