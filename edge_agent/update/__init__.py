"""Secure updates at the robot: signed bundles fetched, checked, installed beside what runs, then kept or taken back."""

from __future__ import annotations

__all__: list[str] = []
