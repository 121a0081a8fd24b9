"""Secure updates: the TUF repository and what of it goes to which robot."""

from __future__ import annotations

__all__: list[str] = []
