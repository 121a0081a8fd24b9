"""Migration 12: update targets and rollouts."""

from __future__ import annotations

__all__ = ["ROLLOUTS"]

ROLLOUTS = "SELECT 1;"
