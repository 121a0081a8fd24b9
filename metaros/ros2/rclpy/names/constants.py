"""`rclpy.constants`: units of time."""

from __future__ import annotations

from typing import Final

__all__ = ["S_TO_NS"]

S_TO_NS: Final = 1_000_000_000
