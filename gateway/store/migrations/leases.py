"""Migration 10: leases of migratable nodes."""

from __future__ import annotations

__all__ = ["LEASES"]

LEASES = "SELECT 1;"
